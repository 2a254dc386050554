"""What changes the body's tensor of inertia: mass that moves, and elasticity.

**Mass that moves**: principal moments as expressions of time and user-defined states. What moves does so
symmetrically: it carries no momentum relative to the body axes, and leaves the centre of mass
where it is. With I(t) in the body axes

    L = I w,    I w' = (I w) x w - I' w + N,    T = w . I w / 2,    T' = w . N - w . I' w / 2

(Hughes, Spacecraft Attitude Dynamics, 1986, section 3.5). I' is the derivative along the motion: that by t
plus those by own states times their derivatives. What moves the masses does the work -w . I' w / 2; energy of
their motion relative to the body isn't counted. In a field, potential energy changes by dV/dI : I', too.

**An elastic body**: tides and spin distort its tensor of inertia, with a delay. The states of the rates are
the rates of the undistorted body with the same momentum, w0 = I^-1 M, so that the distorted tensor's rate of
change is needed nowhere: M' = M x w + N, w = (I + D)^-1 M; what D is, ``Distortion`` works out.

Energy of rotation with the elastic one is w . M / 2 + (K/8) F : F, where (K/2) F is D without its constant
part and K = 2 k R^5/(3 G): the Legendre transform of a linear elastic body. Without delay it is conserved
with the potential energy wherever a rigid body's energy is. With one, E0 = w0 . M / 2 has the exact
derivative w . N + (w0 - w) . M', the power that the distortion takes or gives: the rest is a function of
the state.

With the Love number k, the radius R and a delay tau, the tensor of inertia gains D = d(t - tau),

    d = -k (R^5/G) sum of G M' (u u^T - 1/3) / r^3 + k R^5/(3 G) (w w^T - w^2/3) + const,

where u is the direction to a source and r its distance, all in the body axes of then (Munk & MacDonald 1960,
The Rotation of the Earth, ch. 5; Williams et al. 2001, J. Geophys. Res. 106, 27933). It is expanded,

    D = d - tau d' + tau^2/2 d'',

with w' of the undistorted body under its own gyroscopic torque and the sources'.

The momentum M = (I + D) w determines w. In D stands the rate w* of a body without delay, which solves M = (I
+ d(w*)) w*; it is found from w0 = I^-1 M, the rate of the undistorted body, by as many iterations of w = w0 -
(I + d(w))^-1 d(w) w0 as the precision takes. So nothing is implicit, M' = M x w + N is exact, and without a
delay so is everything else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import heyoka as hy

from rigidsim.errors import ConfigError, Problem, ensure, required
from rigidsim.model.kinematics import (
    ConstantInertia,
    Kinematics,
    MassDistribution,
    absent,
    in_common_unit,
    inertia_times,
)
from rigidsim.model.load import Load, loads_of
from rigidsim.model.loads.gravity import Attraction
from rigidsim.model.mechanics import Carrier, Mechanics
from rigidsim.model.names import written
from rigidsim.model.own_states import driven, own_blocks
from rigidsim.model.placements import SourceMotion
from rigidsim.model.rotations import Symbolic, transpose
from rigidsim.model.rotations import apply as turned
from rigidsim.model.scaling import Scaling, source_rate
from rigidsim.model.step_limiter import along_the_motion
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Matrix, Vector, apply, cross, dot, norm, working_epsilon
from rigidsim.scene.attitude import rotation_matrix
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Expression, ExpressionError, evaluate, names_used, states_read
from rigidsim.scene.kernels.reading import RelativeEphemeris
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT
from rigidsim.scene.readable import span_text
from rigidsim.scene.registry import EffectPart, Setting, names_of, register_load
from rigidsim.scene.scene import Scene, formulas_of, least_part, start_values
from rigidsim.scene.schema import Config
from rigidsim.scene.swept import plain
from rigidsim.scene.validation_messages import nearest

_ELEMENTS = ("moment_x", "moment_y", "moment_z")
_SLACK, _SLACK_SINGLE = 2.0**-40, 2.0**-16
"""Part of their sum by which the moments of a flat body may break I1 + I2 >= I3, plus rounding."""
_TIMES = 512  # of a run's span, at which moments are looked at
_DRIVEN_EACH, _PARTS = 32, (1.0, -1.0, 0.5, -0.5, 0.25, -0.25, 0.0625, -0.0625)
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
        unit = m.scaled(1, -m.scaling.inertia)
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
                changes.append(along_the_motion(moments[-1], slopes))
            else:
                moments.append(hy.expression(m.scaled(given, -m.scaling.inertia)))
                changes.append(0.0)
        return MassDistribution(_diagonal(moments), _diagonal(changes))

    def endings(self, m: Kinematics) -> list[tuple[str, Symbolic]]:
        """I1 + I2 - I3 and its like, and each moment, which are above zero for every body."""
        single = m.scene.config.integrator.precision == "single"
        slack, least = _SLACK_SINGLE if single else _SLACK, least_part("single" if single else "")
        moments = [m.carried(m.shape).matrix[i][i] for i in range(3)]
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
        changes = [m.carried(m.carried(m.shape).change)[i][i] for i in range(3)]
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
        largest = self._fall(scene)
        return energy * (2 ** math.frexp(largest)[1]) if largest > 1 + _LITTLE else context.zero

    def _fall(self, scene: Scene) -> float:
        """Largest ratio by which a moment falls at times of the run; at some of them user-defined states go
        to where they are driven then, all together, part of the way or as far to the other side.
        """
        context, span, values = scene.context, scene.end - scene.start, start_values(scene)
        begun = [float(plain(x)) for x in scene.body.principal_moments]
        sizes, found = {x.name: abs(x.initial) for x in scene.states}, 1.0
        for n in range(_TIMES + 1):
            values["t"], driving = scene.start + span * n / _TIMES, bool(self.reads) and n % _DRIVEN_EACH == 0
            ends = {
                x.name: driven(scene, x.name, values, sizes, span) if driving else x.initial
                for x in scene.states
            }
            for part in _PARTS if driving else (1.0,):
                there = {x.name: x.initial + part * (ends[x.name] - x.initial) for x in scene.states}
                there["t"] = values["t"]
                try:
                    moments = [
                        float(plain(evaluate(x, there, context)))
                        if isinstance(x, Expression) and (driving or names_used(x) == {"t"})
                        else now
                        for x, now in zip(self.moments, begun, strict=True)
                    ]
                except ExpressionError:
                    continue
                if min(moments) > 0 and sum(moments) * (1 + _LITTLE) >= 2 * max(moments):  # of a body
                    found = max(found, *(min(a / b, _MOST) for a, b in zip(begun, moments, strict=True)))
        return found

    # --- what readers see --------------------------------------------------------------------------------


def _diagonal(elements: list[Any]) -> list[list[Any]]:
    return [[elements[i] if i == j else 0.0 for j in range(3)] for i in range(3)]


# --- an elastic body ----------------------------------------------------------------------------------------

Linear = Callable[[list[Any]], list[Any]]
"""A constant tensor times a vector."""


@dataclass(frozen=True)
class SeenTide(SourceMotion):
    """A source that raises tides; its motion in space is given by components along the body axes.

    Attributes:
        lift: k R^5 M' over the unit of length to the third, internal units of inertia.
        pull: 3 G M' over the same, internal units.
    """

    lift: Any
    pull: Any

    @property
    def fifth(self) -> Any:
        """1 / distance^5."""
        return self.inverse**3 * (self.inverse * self.inverse)


def total(terms: Sequence[Any]) -> Any:
    """Sum of numbers or of expressions."""
    if any(isinstance(x, hy.expression) for x in terms):
        return hy.sum([hy.expression(x) for x in terms])
    found = terms[0]
    for x in terms[1:]:
        found = found + x
    return found


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return total([x * y for x, y in zip(a, b, strict=True)])


def _plus(*vectors: Sequence[Any]) -> list[Any]:
    return [total(parts) for parts in zip(*vectors, strict=True)]


def _times(factor: Any, vector: Sequence[Any]) -> list[Any]:
    return [factor * x for x in vector]


@dataclass(frozen=True)
class Distortion:
    """The elastic body; constants are numbers of the arithmetic in which it is asked.

    Attributes:
        spin: k R^5 / (3 G), internal units.
        delay: tau, internal units; 0 for none.
        third: one third.
        offset: constant part of the distortion.
        tensor: of what turns with the body, undistorted.
        turning, solved: that tensor, and its inverse, times a vector.
        massive: tensor of the mass distribution, undistorted, times a vector.
        iterations: of the rate without delay.
    """

    spin: Any
    delay: Any
    third: Any
    offset: Matrix
    tensor: Matrix
    turning: Linear
    solved: Linear
    massive: Linear
    iterations: int

    def found(self, bare: list[Any], tides: Sequence[SeenTide]) -> tuple[Matrix, list[Any]]:
        """D, and what the angular velocity differs by from ``bare`` (w0)."""
        rate, fixed = self._without_delay(bare, tides)
        found = self._joined(fixed, _outer(rate, None, self.spin))
        if self.delay != 0:
            found = self._delayed(rate, tides)
        return found, self.rate_correction(found, bare)

    def _without_delay(self, bare: list[Any], tides: Sequence[SeenTide]) -> tuple[list[Any], Matrix | None]:
        """The rate w*, and the tides' part of the tensor with its trace."""
        fixed = self._sum([_outer(tide.place, tide.fifth, -tide.lift) for tide in tides])
        rate = bare
        for _ in range(self.iterations):
            rate_correction = self.rate_correction(self._joined(fixed, _outer(rate, None, self.spin)), bare)
            rate = _plus(bare, rate_correction)
        return rate, fixed

    def rate_correction(self, distortion: Matrix, bare: list[Any]) -> list[Any]:
        """-(I + D)^-1 D w0, by the adjugate."""
        (a, f, e), (_, b, d), (_, _, c) = [
            [total([x, y]) if x != 0 else y for x, y in zip(*rows, strict=True)]
            for rows in zip(self.tensor, distortion, strict=True)
        ]
        minors = [
            [b * c - d * d, d * e - c * f, d * f - b * e],
            [d * e - c * f, a * c - e * e, e * f - a * d],
            [d * f - b * e, e * f - a * d, a * b - f * f],
        ]
        pushed = [_dot(row, bare) for row in distortion]
        factor = -1.0 / total([a * minors[0][0], f * minors[0][1], e * minors[0][2]])
        return [factor * _dot(row, pushed) for row in minors]

    # --- the tensors ----------------------------------------------------------------------------------------

    def _followed(
        self, rate: list[Any], tides: Sequence[SeenTide]
    ) -> tuple[list[Any], list[Any], list[list[Any]]]:
        """First and second derivative of a rate w* along the undistorted motion, and for each tide those of x
        in body axes, and 1 / r^5 with its own.
        """
        momentum = self.turning(rate)
        torque, change = [cross(momentum, rate)], []
        for tide in tides:
            torque.append(tide_torque(tide, self.massive))
        turning = self.solved(_plus(*torque))
        found = []
        for tide in tides:
            x, v, inverse = tide.place, tide.velocity, tide.inverse
            moved = _plus(v, cross(x, rate))
            again = _plus(tide.acceleration, cross(_plus(v, moved), rate), cross(x, turning))
            squared, fifth = inverse * inverse, tide.fifth
            grown = 2.0 * _dot(x, v) * squared  # (r^2)' / r^2
            faster = 2.0 * total([_dot(v, v), _dot(x, tide.acceleration)]) * squared - grown * grown
            first = -2.5 * grown * fifth
            second = (6.25 * grown * grown - 2.5 * faster) * fifth
            found.append([moved, again, fifth, first, second])
            into = cross(moved, self.massive(x)), cross(x, self.massive(moved))
            tugged = _times(first, cross(x, self.massive(x)))
            change.append(_times(tide.pull, _plus(tugged, *(_times(fifth, y) for y in into))))
        change += [cross(self.turning(turning), rate), cross(momentum, turning)]
        return turning, self.solved(_plus(*change)), found

    def _delayed(self, rate: list[Any], tides: Sequence[SeenTide]) -> Matrix:
        """D for a rate w*, to second order in the delay."""
        late, half = -self.delay, self.delay * self.delay * 0.5
        turning, jerk, followed = self._followed(rate, tides)
        parts = []
        for tide, (moved, again, fifth, first, second) in zip(tides, followed, strict=True):
            both = total([fifth, late * first])
            scale = total([both, half * second]), 2.0 * both, 2.0 * fifth
            series = tide.place, _times(late, moved), _times(half, again)
            parts.append(_scaled(_expanded(series, scale, fifth), -tide.lift))
        series = rate, _times(late, turning), _times(half, jerk)
        parts.append(_scaled(_expanded(series, (1.0, 2.0, 2.0), 1.0), self.spin))
        return self._joined(self._sum(parts), None)

    def power(self, bare: list[Any], tides: Sequence[SeenTide]) -> Any:
        """-T : D' / 2 with T the tidal tensor, sum of pull (x x^T - r^2/3) / r^5, and D' to first order in
        the delay, whose second contributes nothing to a mean.
        """
        late, rate = -self.delay, self._without_delay(bare, tides)[0]
        turning, jerk, followed = self._followed(rate, tides)
        changes = []  # symmetric parts of a p^T, and c e e^T
        for tide, (moved, again, fifth, first, second) in zip(tides, followed, strict=True):
            terms = (total([first, late * second]), tide.place), (2.0 * fifth + 4.0 * late * first, moved)
            along = _plus(*(_times(c, x) for c, x in (*terms, (2.0 * late * fifth, again))))
            changes.append((-tide.lift, tide.place, along, 2.0 * late * fifth, moved))
        along = _plus(_times(2.0, turning), _times(2.0 * late, jerk))
        changes.append((self.spin, rate, along, 2.0 * late, turning))
        found = []
        for tide in tides:
            x, third = tide.place, self.third / (tide.inverse * tide.inverse)
            for size, a, p, c, e in changes:
                drawn = total([_dot(x, a) * _dot(x, p), c * (_dot(x, e) * _dot(x, e))])
                trace = total([_dot(a, p), c * _dot(e, e)])
                found.append(-0.5 * tide.pull * tide.fifth * size * (drawn - third * trace))
        return total(found)

    def _sum(self, parts: Sequence[Matrix]) -> Matrix | None:
        if not parts:
            return None
        return [[total([part[i][j] for part in parts]) for j in range(3)] for i in range(3)]

    def _joined(self, one: Matrix | None, other: Matrix | None) -> Matrix:
        """Their sum without its trace, plus the constant part."""
        found = required(self._sum([x for x in (one, other) if x is not None]))
        mean = -self.third * total([found[i][i] for i in range(3)])
        rows = []
        for i in range(3):
            row = list(found[i])
            row[i] = total([row[i], mean])
            rows.append([total([x, y]) if y != 0 else x for x, y in zip(row, self.offset[i], strict=True)])
        return rows


def tide_torque(tide: SeenTide, massive: Linear) -> list[Any]:
    """MacCullagh's torque of a source on the undistorted body."""
    return _times(tide.pull * tide.fifth, cross(tide.place, massive(tide.place)))


def _outer(vector: list[Any], factor: Any, scale: Any) -> Matrix:
    """scale factor v v^T; a factor of None is 1."""
    size = scale if factor is None else scale * factor
    scaled = _times(size, vector)
    return [[scaled[min(i, j)] * vector[max(i, j)] for j in range(3)] for i in range(3)]


def _expanded(series: Sequence[list[Any]], scale: Sequence[Any], least: Any) -> Matrix:
    """f x x^T to second order, from the terms of x and sums of the terms of f: with x = a + b + c it is the
    symmetric part of a (s0 a + s1 b + s2 c)^T, plus f b b^T.
    """
    a, b, _ = series
    d = _plus(*(_times(factor, x) for factor, x in zip(scale, series, strict=True)))
    rows: list[list[Any]] = [[None] * 3 for _ in range(3)]
    for i in range(3):
        for j in range(i, 3):
            mixed = a[i] * d[i] if i == j else 0.5 * total([a[i] * d[j], a[j] * d[i]])
            rows[i][j] = rows[j][i] = total([mixed, least * (b[i] * b[j])])
    return rows


def _scaled(matrix: Matrix, factor: Any) -> Matrix:
    return [_times(factor, row) for row in matrix]


T = TypeVar("T")
_LINEAR = 0.1  # of a moment, up to which a linear response makes sense


WHERE = "[body] elasticity"
_LATE, _TOO_LATE = 0.3, 1.0
"""Radians by which body and source together may turn within the delay: at the first, what the expansion
leaves out is some percent of what the delay does, which is reported, and at the second about as much.
"""
_WIDE = (0.05, 1.0)
"""C/(M R^2) of a body whose mean radius is R: 2/5 is a sphere's, 0.21 Saturn's."""
_SMALLEST_IN_KM = 0.01
"""Of a number that may have been meant in km: nobody gives less than ten metres so."""
_RAISING = "gravity_gradient"
_DERIVATIVES = 2  # of the place


def fault(key: str, text: str) -> ConfigError:
    """The error that names a key."""
    return ConfigError(Problem(f"{WHERE} {key}".rstrip(), text))


def _raising(config: Config, names: list[str] | None) -> tuple[int, ...]:
    """Places of the named loads, or of all gravity gradients."""
    kinds = [fields.kind for fields in config.loads]  # type: ignore[attr-defined]
    if names is None:
        return tuple(n for n, kind in enumerate(kinds) if kind == _RAISING)
    known = {name: n for n, fields in enumerate(config.loads) for name in names_of(fields)}
    for name in names:
        if name not in known:
            allowed = ", ".join(known) or f"none, since no {_RAISING} has a name"
            raise fault("raised_by", f'given "{name}"{nearest(name, known)}; allowed: {allowed}')
        ensure(
            kinds[known[name]] == _RAISING,
            fault(
                "raised_by",
                f'given "{name}", a load of kind {kinds[known[name]]}; the source of a {_RAISING} '
                "raises "
                "tides: name that, or add one",
            ),
        )
    found = tuple(known[name] for name in names)
    ensure(
        len(set(found)) == len(found),
        fault("raised_by", "the same source is named twice; name each once"),
    )
    return found


def _of_sources(config: Config, raising: tuple[int, ...]) -> str:
    names = [next(iter(names_of(config.loads[n])), f"[[loads]] number {n + 1}") for n in raising]
    return f"tides of {', '.join(names)}" if names else "tides"


@register_load(body="elasticity")
@dataclass(frozen=True)
class Elasticity(Load, Carrier):
    """The distortion; numbers are mpf, SI."""

    love_number: Any
    radius: Any
    delay: Any
    mean_rate: Any | None
    raising: tuple[int, ...]  # places in [[loads]]
    sights: tuple[tuple[RelativeEphemeris, int], ...]  # of a kernel, with derivatives
    spins: bool = True  # whether the spin distorts, too

    title = "elasticity"
    wide = True  # some hundreds of expressions
    changes = "the moments of an elastic body vary"
    conservative = True  # its work is in ``supplied_power``
    nothing = {"love_number": 0}  # noqa: RUF012

    @classmethod
    def brought_by(cls, config: Config) -> bool:
        return config.body.elasticity is not None

    @classmethod
    def resolve(cls, fields: Config, around: Setting) -> Elasticity:
        table, context = required(fields.body.elasticity), around.context
        love, radius, delay = (x.at(context) for x in (table.love_number, table.radius, table.delay))
        ensure(
            not around.free_flight,
            fault(
                "",
                "given for a body with a position or velocity, whose flight treats it as rigid; leave "
                "out [initial] position and velocity, and give the source's orbit",
            ),
        )
        ensure(
            not any(isinstance(x, str) for x in fields.body.principal_moments or []),
            fault("", "given with principal_moments that vary; only one of them can change the tensor"),
        )
        ensure(
            fields.initial.angular_momentum is None,
            ConfigError(
                Problem(
                    "[initial] angular_momentum",
                    "given with [body] elasticity, on which it depends what the rates are then; give "
                    "angular_velocity",
                )
            ),
        )
        rate = None if table.mean_rate is None else table.mean_rate.at(context)
        raising = _raising(fields, table.raised_by)
        named = [source for n in raising if (source := getattr(fields.loads[n], "source", None)) is not None]
        seen = around.ephemeris
        sights = () if seen is None else tuple((seen.sight(x, around.host), _DERIVATIVES) for x in named)
        return cls(love, radius, delay, rate, raising, sights, table.spin)

    @staticmethod
    def effect_parts(fields: Config) -> Iterator[EffectPart]:
        """Its delay; tides and the spin's distortion, where there are both."""
        table = required(fields.body.elasticity)
        missing = "" if table.delay.sign else "it is 0"
        yield EffectPart("delay", "delay of the distortion", {"delay": 0}, missing=missing)
        raising = _raising(fields, table.raised_by)
        both = bool(raising) and table.spin
        missing = "" if both else "no source raises any" if table.spin else "tides alone distort the body"
        yield EffectPart("tides", _of_sources(fields, raising), {"raised_by": []}, missing=missing)
        missing = "" if both else "the spin alone distorts the body" if table.spin else "spin is false"
        yield EffectPart("spin", "distortion by the spin", {"spin": False}, missing=missing)

    @staticmethod
    def without_loads(config: Config, names: Collection[str]) -> Mapping[str, Any]:
        """Sources that are gone raise no tides."""
        given = config.body.elasticity and config.body.elasticity.raised_by
        kept = [name for name in given or [] if name not in names]
        return {"raised_by": kept} if kept != (given or []) else {}

    @cached_property
    def strength(self) -> Any:
        """k R^5 / G, kg s^2."""
        return self.love_number * self.radius**5 / self.radius.context.mpf(GRAVITATIONAL_CONSTANT)

    def acts(self) -> bool:
        return bool(self.love_number != 0 and (self.raising or self.spins))

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset({"attitude"} if self.raising else ())

    def sources(self, scene: Scene) -> list[Attraction]:
        """The sources that raise tides.

        Raises:
            ConfigError: a source whose derivatives aren't known.
        """
        found = [scene.given_loads[n].gradient_source for n in self.raising]
        sources = [source for source in found if source is not None]
        for source in sources:
            ensure(
                not (why := source.placement.untracked),
                fault(
                    "raised_by",
                    f"given a source whose velocity isn't known: {why}; give it an orbit by elements, "
                    "take it from a kernel, make it one of [[bodies]], or name others here",
                ),
            )
        return sources

    # --- the tensor -----------------------------------------------------------------------------------------

    def shape(self, m: Kinematics) -> MassDistribution:
        """The distorted tensor, internal units."""
        tensor, rate_correction = self._of(m, Distortion.found)
        rows = zip(m.numbers.inertia, tensor, strict=True)
        matrix = [
            [total([rounded(m.number(x)), y]) if x != 0 else y for x, y in zip(*row, strict=True)]
            for row in rows
        ]
        return MassDistribution(matrix, None, rate_correction, tensor)

    def power(self, m: Kinematics) -> Symbolic:
        """Power that the tides put into the distortion, internal units of energy over time."""
        return self._of(m, Distortion.power)

    def _of(self, m: Kinematics, ask: Callable[[Distortion, list[Symbolic], list[SeenTide]], T]) -> T:
        """What is asked of the distortion, with expressions of the states."""
        scene, scaling = m.scene, m.scaling
        states = list(hy.make_vars(*m.body.rates))
        bare = in_common_unit(states, m.numbers.rate_units, m.number)
        tides = []
        for load in self.sources(scene):
            motion = load.placement.motion(m)
            vectors = motion.place, motion.velocity, motion.acceleration
            place, velocity, acceleration = (turned(transpose(m.matrix), x) for x in vectors)
            lift, pull = (rounded(m.number(x)) for x in self._sizes(load, motion.unit, scaling))
            sizes = motion.inverse, motion.unit, lift, pull
            tides.append(SeenTide(place, velocity, acceleration, *sizes))
        rigid_body = replace(m, shape=None)
        rigid = ConstantInertia.of(m.numbers, m.number, scene.context)
        *constants, offset = self._constants(scene, scaling.time, scaling.inertia)
        spin, delay, third = (rounded(m.number(x)) if x != 0 else 0 for x in constants)
        distortion = Distortion(
            spin,
            delay,
            third,
            offset=_rounded(m, offset),
            tensor=_rounded(m, m.numbers.turning_inertia),
            turning=rigid.times,
            solved=rigid.solved,
            massive=lambda x: inertia_times(rigid_body, x),
            iterations=self.iterations(scene),
        )
        return ask(distortion, bare, tides)

    def _sizes(self, load: Attraction, unit: Any, scaling: Scaling) -> tuple[Any, Any]:
        """``SeenTide.lift`` and ``pull``, internal units."""
        strength = load.gravitational_parameter / unit**3
        context = unit.context
        return (
            context.ldexp(self.strength * strength, -scaling.inertia),
            context.ldexp(3 * strength, 2 * scaling.time),
        )

    def _constants(self, scene: Scene, time: int, inertia: int) -> tuple[Any, Any, Any, Matrix]:
        """First members of ``Distortion``, in units of 2^time s and 2^inertia kg m^2."""
        context = scene.context
        spin = context.ldexp(self.strength / 3, -inertia) if self.spins else context.zero
        rate, pole, third = self.known_rate(scene), scene.figure.pole, context.one / 3
        size = spin * rate * rate
        offset = [
            [size * ((third if i == j else context.zero) - pole[i] * pole[j]) for j in range(3)]
            for i in range(3)
        ]
        return context.ldexp(spin, -2 * time), context.ldexp(self.delay, -time), third, offset

    def known_rate(self, scene: Scene) -> Any:
        """Spin whose distortion is in the body's moments already, rad/s."""
        if self.mean_rate is not None:
            return self.mean_rate
        return dot(scene.figure.pole, scene.angular_velocity)

    # --- sizes ----------------------------------------------------------------------------------------------

    def shares(self, scene: Scene) -> tuple[Any, Any]:
        """Bounds of the distortion, and of what the spin's changes by where the rate does, over the least
        moment.
        """
        context = scene.context
        least = context.minimum(scene.body.principal_moments)
        ensure(
            least > 0,
            fault("", "given for a body without inertia about an axis; give it some, or leave it out"),
        )
        squared = dot(scene.angular_velocity, scene.angular_velocity)
        spin = self.strength / 3 * (squared + self.known_rate(scene) ** 2) / least
        tide = context.zero
        for load in self.sources(scene):
            nearest = load.placement.nearest(scene)
            tide = tide + self.strength * load.gravitational_parameter / nearest**3 / least
        return (spin + tide, 2 * spin) if self.spins else (tide, context.zero)

    def iterations(self, scene: Scene) -> int:
        """Of the rate without delay, until the remainder is less than rounding."""
        distorted, factor = self.shares(scene)
        if distorted > _LINEAR:
            raise fault(
                "",
                f"given numbers by which the tensor changes by up to {float(plain(distorted)):.3g} of "
                f"the least moment; up to {_LINEAR:g} is allowed, since the response is linear: check "
                "love_number, radius, and G M and distances of the sources",
            )
        if (angle := self.turned_within(scene)) > _TOO_LATE:
            raise fault(
                "delay",
                f"given {span_text(float(plain(self.delay)), 4)}, in which body and source turn by "
                f"{angle:.3g} rad; up to {_TOO_LATE:g} is allowed, for a series in the delay",
            )
        least, count = working_epsilon(scene.context) / 4, 0
        left = distorted * factor
        while left > least:
            left, count = left * factor, count + 1
        return count if self.spins else max(count, 1)  # the tide alone doesn't depend on the rate

    def turned_within(self, scene: Scene) -> float:
        """Radians by which the body and the fastest source turn within the delay."""
        rate = norm(scene.context, scene.angular_velocity)
        fastest = source_rate(scene) if self.raising else scene.context.zero
        return float(plain(self.delay * (rate + fastest)))

    def cautions(self, fields: Any, where: str, scene: Scene) -> Iterator[Caution]:
        yield from _about_radius(fields, scene)
        if (turned := self.turned_within(scene)) > _LATE:
            late = span_text(float(plain(self.delay)), 4)
            yield Caution(
                WarningCode.DELAY_TOO_LONG,
                f"{WHERE} delay: in {late} body and source turn by {turned:.2g} rad; the expansion to "
                f"second order neglects some {turned**2 / 6:.1%} of the delay's effect",
            )

    # --- at the start, in numbers ---------------------------------------------------------------------------

    def begun(self, scene: Scene) -> tuple[Matrix, Vector, Vector]:
        """D, the momentum and w0 at the start (mpf, SI), where the angular velocity is given."""
        context = scene.context
        inside = transpose(rotation_matrix(scene.quaternion))
        tides = []
        for load in self.sources(scene):
            place, velocity, acceleration = (apply(inside, x) for x in load.placement.motion_at_start(scene))
            strength, inverse = load.gravitational_parameter, 1 / norm(context, place)
            sizes = context.one, self.strength * strength, 3 * strength
            tides.append(SeenTide(place, velocity, acceleration, inverse, *sizes))
        turning, inverse_tensor, massive = scene.turning_inertia, scene.inverse_inertia, scene.body.inertia
        distortion = Distortion(
            *self._constants(scene, 0, 0),
            tensor=turning,
            turning=lambda x: apply(turning, x),
            solved=lambda x: apply(inverse_tensor, x),
            massive=lambda x: apply(massive, x),
            iterations=self.iterations(scene),
        )
        rates, bare = scene.angular_velocity, list(scene.angular_velocity)
        tensor, _ = distortion.found(bare, tides)
        for _ in range(self.iterations(scene) + 2):
            added = apply(inverse_tensor, apply(tensor, rates))
            bare = [x + y for x, y in zip(rates, added, strict=True)]
            tensor, _ = distortion.found(bare, tides)
        return tensor, apply(turning, bare), bare

    # --- as a carrier: of none but of energy ----------------------------------------------------------------

    def carried_at_start(self, scene: Scene) -> tuple[Vector, Any]:
        """What the momentum exceeds I w by, and the energy without w0 . M / 2."""
        tensor, momentum, bare = self.begun(scene)
        rates = scene.angular_velocity
        lost = [x - y for x, y in zip(rates, bare, strict=True)]
        offset = self._constants(scene, 0, 0)[3]
        bent = [[x - y for x, y in zip(*rows, strict=True)] for rows in zip(tensor, offset, strict=True)]
        squared = sum((x * x for row in bent for x in row), scene.context.zero)
        energy = dot(lost, momentum) / 2 + 3 * squared / (4 * self.strength)  # (K/8) F : F
        for load in loads_of(scene):
            fixed = load.fixed_source(scene) if load.conservative else None
            if fixed is not None and self._lends(scene):
                towards = apply(transpose(rotation_matrix(scene.quaternion)), fixed[1])
                energy = energy + fixed[0] / 2 * dot(towards, apply(tensor, towards))
        return apply(tensor, rates), energy

    def carried_energy(self, m: Kinematics) -> Symbolic | None:
        """(w - w0) . M / 2, and the elastic energy."""
        context, scaling = m.scene.context, m.scaling
        offset = self._constants(m.scene, scaling.time, scaling.inertia)[3]
        bent = [
            total([x, hy.expression(rounded(m.number(-y)))]) if y != 0 else x
            for rows in zip(m.carried(m.carried(m.shape).distortion), offset, strict=True)
            for x, y in zip(*rows, strict=True)
        ]
        size = context.ldexp(3 / (4 * self.strength), scaling.inertia + 2 * scaling.time)
        elastic = rounded(m.number(size)) * hy.sum([x * x for x in bent])
        lost = [0.5 * x * y for x, y in zip(m.carried(m.rate_correction), m.own_momentum, strict=True)]
        return hy.sum([*lost, elastic])

    def lends(self, m: Kinematics) -> bool:
        """Whether its work is counted: where it dissipates, or its forces have no potential."""
        return self._lends(m.scene)

    def _lends(self, scene: Scene) -> bool:
        if self.delay != 0 or not self.spins:  # nor is the tide alone a minimum of the energy
            return True
        others = [load for load in loads_of(scene) if load is not self]
        raising = [scene.given_loads[n] for n in self.raising]
        drawn = [load for load in others if load.gradient_source is not None]
        if any(all(x is not y for y in raising) for x in drawn):
            return True  # whose potential the distortion changes without being caused by it
        alone = len(others) == 1 and others[0].corotating_orbit is not None
        return not (alone or all(load.conservative for load in others))

    def supplied_power(self, m: Kinematics) -> Symbolic | None:
        """(w0 - w) . M', and the torque on the distortion in fields with a potential times w."""
        if not self.lends(m):
            return None
        assert isinstance(m, Mechanics)
        turning = m.inertia.times(in_common_unit(m.accelerations, m.numbers.rate_units, m.number))
        terms = [-(x * y) for x, y in zip(m.carried(m.rate_correction), turning, strict=True)]
        rigid = replace(m, shape=None)
        for load in m.loads:
            if not load.conservative or load is self:
                continue
            for sign, each in ((1.0, m), (-1.0, rigid)):
                for vector, expression in load.torque(each):
                    pairs = zip(vector, m.rates, strict=True)
                    along = hy.sum([rounded(m.number(x)) * w for x, w in pairs if x != 0])
                    terms.append(sign * expression * along)
        return hy.sum(terms)

    # --- what readers see --------------------------------------------------------------------------------


def _rounded(m: Kinematics, matrix: Matrix) -> Matrix:
    return [[rounded(m.number(x)) if x != 0 else 0 for x in row] for row in matrix]


def _about_radius(body: Any, scene: Scene) -> Iterator[Caution]:
    """A radius without a unit that suits the body's mass and moments in km; ``body`` are the keys."""
    given, mass = body.elasticity.radius, scene.body.mass
    if mass is None or not given.assumed or float(given) < _SMALLEST_IN_KM:
        return
    largest = float(plain(max(scene.body.principal_moments)))
    if _WIDE[0] < largest / (float(plain(mass)) * (1e3 * float(given)) ** 2) < _WIDE[1]:
        number = f"{float(given):.10g}"
        yield Caution(
            WarningCode.LENGTH_WITHOUT_UNIT,
            f"{WHERE} radius: given {number} without a unit, so in m; the body's mass and moments suit km: "
            f'write "{number} km" if that is meant, "{number} m" if not',
        )
