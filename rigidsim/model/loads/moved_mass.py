"""Mass that moves within the body: principal moments as expressions of time and user-defined states.

What moves does so symmetrically: it carries no momentum of its own relative to the body axes, and leaves the
centre of mass where it is. With I(t) in the body axes

    L = I w,    I w' = (I w) x w - I' w + N,    T = w . I w / 2,    T' = w . N - w . I' w / 2

(Hughes, Spacecraft Attitude Dynamics, 1986, section 3.5). I' is the derivative along the motion: that by t
plus those by own states times their derivatives. What moves the masses does the work -w . I' w / 2; energy of
their motion relative to the body isn't counted. In a field, potential energy changes by dV/dI : I', too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import heyoka as hy

from rigidsim.model.carriers import Carrier
from rigidsim.model.inertia import MassDistribution, absent
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, loads_of
from rigidsim.model.names import written
from rigidsim.model.own_states import driven, own_blocks
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Expression, ExpressionError, evaluate, names_used, states_read
from rigidsim.scene.initial_values import start_values
from rigidsim.scene.moving_moments import formulas_of, least_part
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.tracing import plain

_CLOCK = "t_of_moments"
_ELEMENTS = ("moment_x", "moment_y", "moment_z")
_SLACK, _SLACK_SINGLE = 2.0**-40, 2.0**-16
"""Part of their sum by which the moments of a flat body may break I1 + I2 >= I3, beside rounding."""
_TIMES = 512  # of a run's span, at which functions of time alone are looked at
_DRIVEN_TIMES, _PARTS = 16, (1.0, -1.0, 0.5, -0.5, 0.25, -0.25, 0.0625, -0.0625)
_MOST = 1e9  # ratio of moments past which no size is estimated
_LITTLE = 1e-6


@register_load(body="principal_moments")
@dataclass(frozen=True)
class MovedMass(Load, Carrier):
    """The mass that moves; ``moments`` are numbers (mpf) or expressions, kg m^2."""

    moments: tuple[Any | Expression, ...]

    title = "principal_moments"
    changes = "principal_moments vary"
    conservative = True  # the work of what moves it is in ``supplied_power``

    @classmethod
    def brought_by(cls, config: Config) -> bool:
        given = config.body.principal_moments or []
        return not all(isinstance(x, ExactNumber) for x in given)

    @classmethod
    def resolve(cls, fields: Config, around: Setting) -> MovedMass:
        given = formulas_of(fields, around.names)
        return cls(tuple(x if names_used(x) else evaluate(x, {}, around.context) for x in given))

    @property
    def formulae(self) -> list[tuple[int, Expression]]:
        """The moments that vary, each with its axis."""
        return [(axis, x) for axis, x in enumerate(self.moments) if isinstance(x, Expression)]

    def acts(self) -> bool:
        """Not if all of them are constant."""
        return bool(self.formulae)

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return states_read(*(x for _, x in self.formulae))

    # --- the tensor -----------------------------------------------------------------------------------------

    def shape(self, m: Kinematics) -> MassDistribution:
        """The tensor of the time, and its derivative along the motion, internal units."""
        context = m.scene.context
        unit = m.number(context.ldexp(context.one, -m.scaling.inertia))
        slopes = {
            name: slope
            for block in own_blocks(m)
            for name, slope in zip(block.names, block.derivatives, strict=True)
        }
        moments: list[Any] = []
        changes: list[Any] = []
        for given in self.moments:
            if isinstance(given, Expression):
                moments.append(unit * written(m, [given])[0])
                changes.append(_along_motion(moments[-1], slopes))
            else:
                moments.append(hy.expression(m.number(context.ldexp(given, -m.scaling.inertia))))
                changes.append(0.0)
        return MassDistribution(_diagonal(moments), _diagonal(changes))

    def endings(self, m: Kinematics) -> list[tuple[str, Symbolic]]:
        """I1 + I2 - I3 and its like, and each moment, which are above zero for every body."""
        single = m.scene.config.integrator.precision == "single"
        slack, least = _SLACK_SINGLE if single else _SLACK, least_part("single" if single else "")
        assert m.shape is not None
        moments = [m.shape.matrix[i][i] for i in range(3)]
        total = hy.sum(moments)
        found = []
        for axis, name in enumerate("xyz"):
            others = [x for i, x in enumerate(moments) if i != axis]
            margin = hy.sum([*others, -moments[axis], slack * total])
            found.append((f"the moment about {name} exceeds the sum of the other two", margin))
        for axis, _ in self.formulae:
            margin = moments[axis] - least * total
            found.append((f"the moment about {'xyz'[axis]} falls below {least:.1g} of their sum", margin))
        return found

    # --- as a carrier: of no momentum, but work -------------------------------------------------------------

    def supplied_power(self, m: Kinematics) -> Symbolic | None:
        """-w . I' w / 2, and what potential energies change by."""
        assert m.shape is not None
        assert m.shape.change is not None
        changes = [m.shape.change[i][i] for i in range(3)]
        terms = [-0.5 * (x * (w * w)) for x, w in zip(changes, m.rates, strict=True) if not absent(x)]
        places = hy.make_vars(*_ELEMENTS)
        apart = replace(m, shape=MassDistribution(_diagonal(list(places)), _diagonal([0.0] * 3)))
        for load in loads_of(m.scene):
            potential = load.potential(apart) if load.conservative and load is not self else None
            if potential is None:
                continue
            known = set(hy.get_variables(hy.expression(potential)))
            for place, name, change in zip(places, _ELEMENTS, changes, strict=True):
                if name in known and not absent(change):
                    terms.append(hy.diff(potential, place) * change)  # linear in the moments
        return hy.sum(terms)

    # --- sizes ----------------------------------------------------------------------------------------------

    def amplitude(self, scene: Scene) -> Any | None:
        """By how much energy of rotation grows as moments shrink, L being kept; a power of two."""
        context = scene.context
        energies = zip(scene.body.principal_moments, scene.angular_velocity, strict=True)
        energy = sum((moment * rate**2 / 2 for moment, rate in energies), context.zero)
        largest = max(self._by_time(scene), self._by_states(scene), 1.0)
        return energy * (2 ** math.frexp(largest)[1]) if largest > 1 + _LITTLE else context.zero

    def _by_time(self, scene: Scene) -> float:
        """Largest ratio by which a moment that depends on time alone falls."""
        found = 1.0
        for axis, expression in self.formulae:
            begun = float(plain(scene.body.principal_moments[axis]))
            for n in range(_TIMES + 1) if names_used(expression) == {"t"} else ():
                then = scene.start + (scene.end - scene.start) * n / _TIMES
                try:
                    moment = float(plain(evaluate(expression, {"t": then}, scene.context)))
                except ExpressionError:
                    continue
                found = max(found, begun / moment) if moment > begun / _MOST else found
        return found

    def _by_states(self, scene: Scene) -> float:
        """Largest ratio by which a moment falls while user-defined states go to where they are driven at some
        times of the run, all together, part of the way or as far to the other side; 1 if none reads them.
        """
        if not self.reads:
            return 1.0
        context, span, values = scene.context, scene.end - scene.start, start_values(scene)
        begun = [float(plain(x)) for x in scene.body.principal_moments]
        sizes, found = {x.name: abs(x.initial) for x in scene.states}, 1.0
        for n in range(_DRIVEN_TIMES + 1):
            values["t"] = scene.start + span * n / _DRIVEN_TIMES
            ends = {x.name: driven(scene, x.name, values, sizes, span) for x in scene.states}
            for part in _PARTS:
                there = {x.name: x.initial + part * (ends[x.name] - x.initial) for x in scene.states}
                there["t"] = values["t"]
                try:
                    moments = [
                        float(plain(evaluate(x, there, context) if isinstance(x, Expression) else x))
                        for x in self.moments
                    ]
                except ExpressionError:
                    continue
                if min(moments) > 0 and sum(moments) >= 2 * max(moments):
                    found = max(found, *(min(a / b, _MOST) for a, b in zip(begun, moments, strict=True)))
        return found

    # --- what readers see --------------------------------------------------------------------------------


def _diagonal(elements: list[Any]) -> list[list[Any]]:
    return [[elements[i] if i == j else 0.0 for j in range(3)] for i in range(3)]


def _along_motion(expression: Symbolic, slopes: dict[str, Symbolic]) -> Symbolic:
    """Derivative of an expression of time and states along the motion, per internal unit of time."""
    clock = hy.make_vars(_CLOCK)
    shown = hy.subs(expression, {hy.time: clock})
    terms = []
    for name in hy.get_variables(shown):
        if name == _CLOCK:
            terms.append(hy.diff(shown, clock))
        elif name in slopes:  # others stand for numbers
            terms.append(hy.diff(shown, hy.make_vars(name)) * slopes[name])
    return hy.subs(hy.sum(terms), {clock: hy.time}) if terms else hy.expression(0.0)
