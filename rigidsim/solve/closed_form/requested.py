"""The closed form that a config asks for, or why it can't have one."""

from __future__ import annotations

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.system import System
from rigidsim.scene.scene import Scene
from rigidsim.solve.closed_form.motion import NoClosedForm
from rigidsim.solve.closed_form.solution import ClosedForm, closed_form_of


def requested_closed_form(scene: Scene, system: System, *, driven: bool) -> ClosedForm:
    """The closed form of a scene whose ``method`` asks for it.

    Args:
        driven: whether loads given from Python act.

    Raises:
        ConfigError: the scene has none, or something requested needs steps.
    """
    integrator = scene.config.integrator
    try:
        closed = closed_form_of(scene, driven=driven)
    except NoClosedForm as none:
        what = f'given "closed_form", but {none}; allowed here: "taylor"'
        raise ConfigError(Problem("[integrator] method", what)) from None
    why = None
    if integrator.hold_invariants is True:
        why = "holds its invariants by itself; set hold_invariants = false"
    elif system.requirements.formulation not in ("rates", "quaternion"):
        why = f'gives rates and quaternions, not {integrator.formulation}; set formulation = "auto"'
    elif scene.events:
        why = 'takes no steps in which events could be found; remove [[events]], or choose method = "taylor"'
    if why is not None:
        raise ConfigError(Problem("[integrator] method", f'given "closed_form", which {why}'))
    return closed
