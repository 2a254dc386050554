"""Which motions have derivatives by numbers of their config, and the system with these as parameters."""

from __future__ import annotations

from collections.abc import Sequence

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load import Load
from rigidsim.model.parametrised import Parametrised
from rigidsim.model.system import System
from rigidsim.scene.choices import FULL
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import Scene
from rigidsim.scene.varied_keys import varied_keys
from rigidsim.solve.precision import precision_of

WHERE = "[output] sensitivity"


def refuse_without_derivatives(scene: Scene, system: System, *, has_steps: bool, where: str = WHERE) -> None:
    """Refuse a motion for which variational equations end, or don't exist.

    Raises:
        ConfigError: single precision, an average, a closed form, kinks and jumps, an end by the loads.
    """
    integrator, found = scene.config.integrator, system.plan.surfaces.found
    why = ""
    if integrator.precision == "single":
        why = 'derivatives lose their digits in single precision; choose precision = "double" or a higher one'
    elif scene.config.model.level != FULL:
        why = f'[model] level = "{scene.config.model.level}" has no attitude to differentiate; choose "full"'
    elif not has_steps:
        why = (
            f'[integrator] method = "{integrator.method}" takes no steps beside which variational equations '
            'could be integrated; choose "taylor"'
        )
    elif found:
        why = (
            f"the equations switch at a kink or jump of {found[0].text} ({found[0].where}), where "
            f"variational equations end; {found[0].remedy}"
        )
    elif system.switches:
        why = (
            "the equations read full turns of Euler angles or the quaternion's sign, which have jumps; write "
            "the load with products of quaternion components"
        )
    elif len(system.crossings) > len(system.events):
        why = "the body changes in a way that may end its motion, where variational equations end"
    elif scene.found_start is not None:
        why = "the start is an equilibrium that is found, not given; give its attitude and rates instead"
    if why:
        raise ConfigError(Problem(where, f"asked for derivatives, but {why}"))


def parametrised(
    experiment: Experiment,
    keys: Sequence[str],
    loads: Sequence[Load] = (),
    where: str = WHERE,
    record: Sequence[str] = (),
) -> Parametrised:
    """The system of an experiment with numbers of its config as parameters.

    Raises:
        ConfigError: a key that stands for no number, or by which the equations have no derivative.
    """
    precision = precision_of(experiment.config.integrator.precision)
    found = varied_keys(experiment, keys, where)
    return Parametrised(experiment, found, precision.number, precision.bits, loads, record)
