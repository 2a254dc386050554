"""Starts in an equilibrium, found by the scene's own equations, each once in a process for one config and
precision: relative equilibria and Cassini states. Importing this enters them into ``rigidsim.scene.starts``.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import partial
from typing import Any

from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import STARTS, InitialRotation, refusal
from rigidsim.scene.swept import SweptContext, Untraceable
from rigidsim.solve.equilibria.cassini import cassini_state
from rigidsim.solve.equilibria.relative import relative_equilibrium
from rigidsim.solve.equilibria.search import NoEquilibrium

_KEPT = 64
_BESIDE = ("name", "description", "integrator", "model", "output", "limits", "sweep", "events")
"""Tables on which no equilibrium depends; the precision is the context's."""
_known: OrderedDict[Any, InitialRotation] = OrderedDict()


def _once(name: str, find: Callable[[Scene], InitialRotation], scene: Scene) -> InitialRotation:
    if isinstance(scene.context, SweptContext):
        raise Untraceable("an equilibrium that is found")
    tables = {name: table for name, table in scene.config if name not in _BESIDE}
    key = scene.context.prec, repr(tables)
    if key not in _known:
        try:
            _known[key] = find(scene)
        except NoEquilibrium as none:
            remedy = "" if ";" in str(none) else "; give the attitude and rates themselves"
            raise refusal("equilibrium", f'given "{name}", but {none}{remedy}') from None
        while len(_known) > _KEPT:
            _known.popitem(last=False)
    found, own = _known[key], scene.context.make_mpf
    quaternion, rates = (
        [own(x._mpf_) for x in vector] for vector in (found.quaternion, found.angular_velocity or ())
    )
    return InitialRotation(quaternion, rates, found=found.found)


_FINDERS: dict[str, Callable[[Scene], InitialRotation]] = {
    "relative": relative_equilibrium,
    **{f"cassini_{number}": partial(cassini_state, number=number) for number in (1, 2, 3, 4)},
}
STARTS.update({name: partial(_once, name, find) for name, find in _FINDERS.items()})
