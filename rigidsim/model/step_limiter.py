"""A state that makes step control see pulses and switches in advance.

heyoka chooses a step from the last Taylor coefficients of the states. A pulse that is flat far from its
middle has vanishing ones: the step would pass over it. Beside the motion the system therefore carries

    pace = sum of log(B^2 + u^2) / 64,   pace' = sum of u u' / (B^2 + u^2) / 32

over the arguments u around whose zeros something happens, such as (t - t0) / width. This function is flat
nowhere, and its series converge as far as its poles, which lie B widths from the pulse's middle: steps
shorten in proportion to the distance, and the cost of a pulse grows only as the logarithm of its width.
(A pulse of width 1e-4 s in a run of 100 s: 143 steps, where steps capped by the width would be a million.)
With B = 4 a function of u is seen on its own account by then, so a wide one costs hardly a step.

To a root of v, which has a kink where v touches zero, belongs the term log(v) / 64: where v does vanish, its
series end there, and so does the run, with steps that collapse, instead of going on along the wrong branch.

Euler angles have no series in a pole of their sequence. Where a motion starts in one and an event reads them,
the first step leaves it by a millionth of a turn, and those that follow grow with the distance.
"""

from collections.abc import Mapping

import heyoka as hy

from rigidsim.model.kinematics import components_of_factor, starts_in_pole
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.names import written
from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.expressions.names import EULER_NAMES
from rigidsim.scene.expressions.tree import names_used
from rigidsim.scene.surfaces import WIDE, narrow_parts, root_parts

PACE = "pace"
_POLE = 2.0**20  # over the factor that vanishes in a pole of the Euler angles
_CLOCK = "t_of_pace"  # stands in for the time, by which heyoka doesn't differentiate


def pace_block(m: Mechanics, before: StateBlock) -> list[StateBlock]:
    """The state that keeps steps from passing over a pulse or a switch in ``before``; none without."""
    watched = _arguments(m)
    rooted = [(load.title, v) for load in m.loads for v in load.roots(m)]
    states = [(f"state {state.name}", state.derivative) for state in m.scene.states]
    rooted += [(title, v) for title, slope in states for v in written(m, root_parts(slope))]
    if not (watched or rooted):
        return []
    derivatives = dict(zip(before.names, before.derivatives, strict=True))
    terms = [0.5 * (along_the_motion(v, derivatives) / v) for _, v in rooted]
    terms += [along_the_motion(u, derivatives) * (u / (WIDE**2 + u * u)) for _, u in watched]
    titles = ", ".join(dict.fromkeys(title for title, _ in [*watched, *rooted]))
    what = " or ".join(["what is narrow"] * bool(watched) + ["a root of zero"] * bool(rooted))
    return [
        StateBlock(
            [PACE],
            [2.0**-5 * hy.sum(terms)],
            [m.scene.context.zero],
            why=f"{titles}: no step may pass over {what} in it",
        )
    ]


def _arguments(m: Mechanics) -> list[tuple[str, Symbolic]]:
    """(description, argument) of what is narrow in loads and events; dimensionless."""
    found = [(load.title, u) for load in m.loads for u in load.narrow(m)]
    states = [(f"state {state.name}", state.derivative) for state in m.scene.states]
    found += [(title, u) for title, slope in states for u in written(m, narrow_parts(slope))]
    angles = frozenset(EULER_NAMES)
    for event in m.scene.events:
        if names_used(event.expression) & angles and starts_in_pole(m.scene):
            found += [(f"event {event.name}", _POLE * x) for x in components_of_factor(m)]
        parts = written(m, narrow_parts(event.expression), clocked=False)
        found += [(f"event {event.name}", part) for part in parts]
    return found


def along_the_motion(u: Symbolic, derivatives: Mapping[str, Symbolic]) -> Symbolic:
    """Time derivative of an expression, internal units; any swept number in it is constant along a motion."""
    by_time, by_state = slopes(u)
    terms = [slope * derivatives[name] for name, slope in by_state.items() if name in derivatives]
    return hy.sum([*terms, *by_time])


def slopes(u: Symbolic) -> tuple[list[Symbolic], dict[str, Symbolic]]:
    """Partial derivatives of an expression: by time, if it depends on it, and by its variables."""
    clock = hy.make_vars(_CLOCK)
    plain = hy.subs(u, {hy.time: clock})
    found = {
        name: hy.subs(hy.diff(plain, hy.make_vars(name)), {clock: hy.time})
        for name in hy.get_variables(plain)
    }
    by_time = [found.pop(_CLOCK)] if _CLOCK in found else []
    return by_time, found
