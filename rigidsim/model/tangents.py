"""A tangent vector carried along with a motion: the growth of a small displacement.

Its equations are the variational ones (Benettin et al. 1980, Meccanica 15, 9; for the use of its
length: ``rigidsim.solve.indicators``). It is carried 2**-900 of its size: step control is relative to the
largest state, of which it is never a part, so that the motion takes the same steps with and without it. Where
equations are compiled in compact mode (beyond double precision) no bit of the motion moves; elsewhere the
compiler may round a product otherwise. Past a growth of e**500 the vector would come near the motion's own
states; long before, the motion is known to be chaotic, and its growth is recorded as NaN.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

import heyoka as hy

from rigidsim.model.mechanics import Mechanics
from rigidsim.model.names import TANGENT
from rigidsim.model.observables.observable import Observable, only_when_named
from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import StateBlock, joined
from rigidsim.scene.choices import DEFAULT_METHOD
from rigidsim.scene.registry import register_observable

GROWTH = "tangent_growth"
SMALL = 900
"""The vector is carried 2**-SMALL of its size."""
LARGEST = 500.0
"""Growth, as a logarithm, past which it is no longer carried small."""
_GOLDEN = (math.sqrt(5) - 1) / 2


def own_names(m: Mechanics) -> list[str]:
    """States of the body itself that are carried: rates, attitude or vertical, position and velocity."""
    names = list(m.attitude.names) if m.attitude is not None else []
    if m.attitude is not None and m.attitude.momenta:
        return [*names, *m.attitude.momenta]
    if m.attitude is None and m.vertical is not None:
        names = m.body.vertical
    return [*m.body.rates, *names, *([*m.body.position, *m.body.velocity] if m.velocity is not None else [])]


def moving_names(own: Iterable[str], reads: Mapping[str, set[str]]) -> set[str]:
    """States whose offsets are the motion's: the body's own, and those coupled to it both ways."""
    own = set(own)
    acting = _reached(own, reads)
    read_by = {name: {other for other in reads if name in reads[other]} for name in reads}
    feeling = _reached(own, read_by)
    return {name for name in reads if name in own or name in acting & feeling}


def _reached(start: set[str], ways: Mapping[str, set[str]]) -> set[str]:
    """All names reachable from the start in any number of steps."""
    found: set[str] = set()
    ahead = {name for name in start if name in ways}
    while ahead:
        ahead = {name for place in ahead for name in ways[place] if name in ways} - found
        found |= ahead
    return found


def tangent_block(m: Mechanics, before: Sequence[StateBlock]) -> StateBlock:
    """The tangent vector of a motion whose states the preceding blocks have."""
    whole = joined(before)
    variables = whole.variables
    own = own_names(m)
    reads = {
        name: set(hy.get_variables(right)) for name, right in zip(whole.names, whole.derivatives, strict=True)
    }
    moving = moving_names(own, reads)
    # what the offset doesn't reach is constant for it: an orbit's position, numbers that differ between
    # members
    places = [n for n, name in enumerate(whole.names) if name in moving]
    names = [whole.names[n] for n in places]
    rights = [whole.derivatives[n] for n in places]
    along = [hy.make_vars(TANGENT + name) for name in names]
    rates = _varied([variables[n] for n in places], rights, along)
    start = _direction(m, own)
    return StateBlock(
        [TANGENT + name for name in names],
        rates,
        [start.get(name, m.scene.context.zero) for name in names],
        exponents=[e for name, e in zip(whole.names, whole.unit_exponents, strict=True) if name in moving],
        why=f"{GROWTH}: a displacement, so small that no step of the motion knows of it",
    )


def _varied(
    states: Sequence[Symbolic], rights: Sequence[Symbolic], along: Sequence[Symbolic]
) -> list[Symbolic]:
    """Rates of a tangent vector of x' = f(x): derivatives of f (``rights``) along it; others are constant."""
    others = sorted({name for right in rights for name in hy.get_variables(right)} - set(map(str, states)))
    taken = max((int(str(par)[1:]) + 1 for par in hy.get_params(rights)), default=0)  # of turns and times
    constants = {hy.make_vars(name): hy.par[taken + n] for n, name in enumerate(others)}
    rights = hy.subs(list(rights), constants) if constants else list(rights)
    # the derivative by one initial value obeys the equations that any tangent vector does
    equations = list(zip(states, rights, strict=True))
    varied = hy.var_ode_sys(equations, [states[0]]).sys[len(equations) :]
    to: dict[Symbolic, Symbolic] = {old: new for (old, _), new in zip(varied, along, strict=True)}
    to |= {constant: variable for variable, constant in constants.items()}
    return [hy.subs(right, to) for _, right in varied]


def _weights(m: Mechanics, names: Sequence[str]) -> list[int]:
    """Binary exponents that make offsets of states comparable: angles in rad, rates in 1 / internal time."""
    rates = dict(zip(m.body.rates, m.scaling.rates, strict=True))
    attitude = m.attitude
    if attitude is not None and attitude.chord is not None:
        rates |= dict.fromkeys(attitude.names, round(math.log2(attitude.chord)))
    return [rates.get(name, 0) for name in names]


def _direction(m: Mechanics, names: Sequence[str]) -> dict[str, object]:
    """Initial direction of the vector (mpf): no special one, and always the same."""
    context = m.scene.context
    parts = [math.copysign(0.5 + (n * _GOLDEN) % 1.0, (-1) ** n) for n in range(1, len(names) + 1)]
    length = math.sqrt(math.fsum(x * x for x in parts))
    weights = _weights(m, names)
    return {
        name: context.ldexp(context.mpf(x / length), -SMALL - weight)
        for name, x, weight in zip(names, parts, weights, strict=True)
    }


def _growth(m: Mechanics) -> list[Symbolic]:
    """ln of the vector's length over the initial one; NaN past ``LARGEST``."""
    names = own_names(m)
    terms = []
    for name, weight in zip(names, _weights(m, names), strict=True):
        unit = m.scaled(1, SMALL + weight)
        scaled = unit * hy.make_vars(TANGENT + name)
        terms.append(scaled * scaled)
    growth = 0.5 * hy.log(hy.sum(terms))
    lost = hy.log(hy.expression(-1.0))
    return [hy.select(hy.lt(growth, LARGEST), growth, lost)]


def _absent(m: Mechanics) -> str | None:
    """Why a scene can't have a tangent vector; None if it can."""
    integrator = m.scene.config.integrator
    if m.attitude is not None and m.attitude.singular_factor is not None:
        return f'formulation = "{integrator.formulation}" has singularities that the vector would feel'
    driven = any(load.orbit for load in m.loads)  # whose phase keeps the steps of any motion short
    if not driven and all(w == 0 for w in m.scene.angular_velocity):
        return "the body is at rest, where steps are as long as one likes; give it a small rate"
    if not driven and m.attitude is not None and m.attitude.momenta:
        return 'without an orbit nothing in a plane keeps the steps short; choose formulation = "quaternion"'
    if m.piecewise:
        return "at rows of a table or edges of blocks states are set, where variational equations end"
    if m.scene.impulses:
        return f"at the impulse {m.scene.impulses[0].name} velocities change at once"
    if integrator.precision == "single":
        return "single precision can't hold a vector that small; choose double"
    if m.surfaces.found:
        return "where the equations switch, at a kink or jump, variational equations end"
    if not integrator.has_steps:
        return (
            "a closed form takes no steps along which a vector could be carried; choose method = "
            f'"{DEFAULT_METHOD}"'
        )
    return None


register_observable(
    Observable(
        GROWTH, (), "1", "natural logarithm of the growth of a small displacement", _growth,
        needs=("attitude",), by_default=only_when_named, absent=_absent,
    )
)  # fmt: skip
