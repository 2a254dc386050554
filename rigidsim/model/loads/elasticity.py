"""An elastic body: tides and spin distort its tensor of inertia, with a delay.

The states of the rates are those of the undistorted body with the same momentum, w0 = I^-1 M, so that the
distorted tensor's rate of change is needed nowhere: M' = M x w + N, w = (I + D)^-1 M; what D is stands in
``rigidsim.model.distortion``.

Energy of rotation with the elastic one is w . M / 2 + (K/8) F : F, where (K/2) F is D without its constant
part and K = 2 k R^5/(3 G): the Legendre transform of a linear elastic body. Without delay it is conserved
with the potential energy wherever a rigid body's energy is. With one, E0 = w0 . M / 2 has the exact
derivative w . N + (w0 - w) . M', which tells what the distortion takes or gives: the rest is a function of
the state.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.distortion import Distortion, SeenTide, total
from rigidsim.model.inertia import ConstantInertia, MassDistribution
from rigidsim.model.kinematics import Kinematics, in_common_unit, inertia_times
from rigidsim.model.load import Load, Term, loads_of
from rigidsim.model.load_words import span_words
from rigidsim.model.loads.attraction import Attraction
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic, transpose
from rigidsim.model.rotations import apply as turned
from rigidsim.model.scaling import Scaling, source_rate
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Matrix, Vector, apply, dot, norm, working_epsilon
from rigidsim.scene.attitude import rotation_matrix
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.kernels.reading import Sight
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT
from rigidsim.scene.registry import Setting, names_of, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.tracing import plain
from rigidsim.scene.validation_messages import nearest

T = TypeVar("T")
_MOST = 0.1  # of a moment, up to which a linear response makes sense


WHERE = "[body] elasticity"
_LATE, _TOO_LATE = 0.3, 1.0
"""Radians by which body and source together may turn within the delay: at the first, what the expansion
leaves out is some percent of what the delay does, which is told, and at the second about as much.
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
        if kinds[known[name]] != _RAISING:
            what = f'given "{name}", a load of kind {kinds[known[name]]}; the source of a {_RAISING} raises '
            raise fault("raised_by", what + "tides: name that, or add one")
    found = tuple(known[name] for name in names)
    if len(set(found)) < len(found):
        raise fault("raised_by", "the same source is named twice; name each once")
    return found


def _of_sources(config: Config, raising: tuple[int, ...]) -> str:
    names = [next(iter(names_of(config.loads[n])), f"[[loads]] number {n + 1}") for n in raising]
    return f"tides of {', '.join(names)}" if names else "tides"


@register_load(body="elasticity")
@dataclass(frozen=True)
class Elasticity(Load):
    """The distortion; numbers are mpf, SI."""

    love_number: Any
    radius: Any
    delay: Any
    mean_rate: Any | None
    raising: tuple[int, ...]  # places in [[loads]]
    sights: tuple[tuple[Sight, int], ...]  # of a kernel, with derivatives
    spins: bool = True  # whether the spin distorts, too

    title = "elasticity"
    wide = True  # some hundreds of expressions
    changes = "the moments of an elastic body vary"
    conservative = True  # its work is told by ``supplied_power``
    nothing = {"love_number": 0}  # noqa: RUF012

    @classmethod
    def brought_by(cls, config: Config) -> bool:
        return config.body.elasticity is not None

    @classmethod
    def resolve(cls, fields: Config, around: Setting) -> Elasticity:
        table, context = fields.body.elasticity, around.context
        assert table is not None
        love, radius, delay = (x.at(context) for x in (table.love_number, table.radius, table.delay))
        if around.free_flight:
            what = "given for a body with a position or velocity, whose flight treats it as rigid; leave "
            raise fault("", what + "out [initial] position and velocity, and give the source's orbit")
        if any(isinstance(x, str) for x in fields.body.principal_moments or []):
            what = "given with principal_moments that vary; only one of them can change the tensor"
            raise fault("", what)
        if fields.initial.angular_momentum is not None:
            what = "given with [body] elasticity, on which it depends what the rates are then; give "
            raise ConfigError(Problem("[initial] angular_momentum", what + "angular_velocity"))
        rate = None if table.mean_rate is None else table.mean_rate.at(context)
        raising = _raising(fields, table.raised_by)
        named = [source for n in raising if (source := getattr(fields.loads[n], "source", None)) is not None]
        seen = around.ephemeris
        sights = () if seen is None else tuple((seen.sight(x, around.host), _DERIVATIVES) for x in named)
        return cls(love, radius, delay, rate, raising, sights, table.spin)

    @staticmethod
    def effect_parts(fields: Config) -> Iterator[EffectPart]:
        """Its delay; tides and the spin's distortion, where there are both."""
        table = fields.body.elasticity
        assert table is not None
        missing = "" if table.delay.sign else "it is 0"
        yield EffectPart("delay", "delay of the distortion", {"delay": 0}, missing=missing)
        raising = _raising(fields, table.raised_by)
        both = bool(raising) and table.spin
        missing = "" if both else "no source raises any" if table.spin else "they are all that distorts"
        yield EffectPart("tides", _of_sources(fields, raising), {"raised_by": []}, missing=missing)
        missing = "" if both else "it is all that distorts" if table.spin else "spin is false"
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
            if why := source.placement.untracked:
                what = (
                    f"given a source whose velocity isn't known: {why}; give it an orbit by elements, take "
                )
                what += "it from a kernel, make it one of [[bodies]], or name others here"
                raise fault("raised_by", what)
        return sources

    # --- the tensor -----------------------------------------------------------------------------------------

    def shape(self, m: Kinematics) -> MassDistribution:
        """The distorted tensor, internal units."""
        tensor, slip = self._of(m, Distortion.found)
        rows = zip(m.numbers.inertia, tensor, strict=True)
        matrix = [
            [total([rounded(m.number(x)), y]) if x != 0 else y for x, y in zip(*row, strict=True)]
            for row in rows
        ]
        return MassDistribution(matrix, None, slip, tensor)

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
            tides.append(SeenTide(place, velocity, acceleration, motion.inverse, lift, pull))
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
        if not least > 0:
            raise fault("", "given for a body without inertia about an axis; give it some, or leave it out")
        squared = dot(scene.angular_velocity, scene.angular_velocity)
        spin = self.strength / 3 * (squared + self.known_rate(scene) ** 2) / least
        tide = context.zero
        for load in self.sources(scene):
            nearest = load.placement.nearest(scene)
            tide = tide + self.strength * load.gravitational_parameter / nearest**3 / least
        return (spin + tide, 2 * spin) if self.spins else (tide, context.zero)

    def iterations(self, scene: Scene) -> int:
        """Of the rate without delay, until what is left is less than rounding."""
        distorted, factor = self.shares(scene)
        if distorted > _MOST:
            what = f"given numbers by which the tensor changes by up to {float(plain(distorted)):.3g} of the "
            what += f"least moment; up to {_MOST:g} is allowed, since the response is linear: check "
            raise fault("", what + "love_number, radius, and G M and distances of the sources")
        if (angle := self.turned_within(scene)) > _TOO_LATE:
            what = (
                f"given {span_words(plain(self.delay))}, in which body and source turn by {angle:.3g} rad; "
            )
            raise fault(
                "delay", what + f"up to {_TOO_LATE:g} is allowed, since what it does is a series in it"
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
        yield from _about_delay(plain(self.delay), self.turned_within(scene))

    # --- at the start, in numbers ---------------------------------------------------------------------------

    def begun(self, scene: Scene) -> tuple[Matrix, Vector, Vector]:
        """D, the momentum and w0 at the start (mpf, SI), where the angular velocity is given."""
        context = scene.context
        inside = transpose(rotation_matrix(scene.quaternion))
        tides = []
        for load in self.sources(scene):
            place, velocity, acceleration = (apply(inside, x) for x in load.placement.motion_at_start(scene))
            strength, inverse = load.gravitational_parameter, 1 / norm(context, place)
            sizes = self.strength * strength, 3 * strength
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

    def carried_momentum(self, m: Kinematics) -> list[Term]:
        return []

    def exerted_torque(self, m: Kinematics) -> list[Term]:
        return []

    def carried_at_start(self, scene: Scene) -> tuple[Vector, Any]:
        """What the momentum exceeds I w by, and the energy beside w0 . M / 2."""
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
        assert m.shape is not None
        assert m.slip is not None
        context, scaling = m.scene.context, m.scaling
        offset = self._constants(m.scene, scaling.time, scaling.inertia)[3]
        bent = [
            total([x, hy.expression(rounded(m.number(-y)))]) if y != 0 else x
            for rows in zip(m.carried(m.shape.distortion), offset, strict=True)
            for x, y in zip(*rows, strict=True)
        ]
        size = context.ldexp(3 / (4 * self.strength), scaling.inertia + 2 * scaling.time)
        elastic = rounded(m.number(size)) * hy.sum([x * x for x in bent])
        lost = [0.5 * x * y for x, y in zip(m.slip, m.own_momentum, strict=True)]
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
        assert m.slip is not None
        turning = m.inertia.times(in_common_unit(m.accelerations, m.numbers.rate_units, m.number))
        terms = [-(x * y) for x, y in zip(m.slip, turning, strict=True)]
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

    # --- what readers are told ------------------------------------------------------------------------------


def _rounded(m: Kinematics, matrix: Matrix) -> Matrix:
    return [[rounded(m.number(x)) if x != 0 else 0 for x in row] for row in matrix]


def _about_delay(delay: Any, turned: float) -> Iterator[Caution]:
    """A delay whose expansion leaves out a part of what it does."""
    if turned > _LATE:
        text = (
            f"{WHERE} delay: in {span_words(delay)} body and source turn by {turned:.2g} rad, of which the "
        )
        text += f"expansion to second order leaves out some {turned**2 / 6:.1%} of what the delay does"
        yield Caution(WarningCode.DELAY_TOO_LONG, text)


def _about_radius(body: Any, scene: Scene) -> Iterator[Caution]:
    """A radius without a unit that suits the body's mass and moments in km; ``body`` are the keys."""
    given, mass = body.elasticity.radius, scene.body.mass
    if mass is None or not given.assumed or float(given) < _SMALLEST_IN_KM:
        return
    largest = float(plain(max(scene.body.principal_moments)))
    if _WIDE[0] < largest / (float(plain(mass)) * (1e3 * float(given)) ** 2) < _WIDE[1]:
        number = f"{float(given):.10g}"
        text = (
            f"{WHERE} radius: given {number} without a unit, which is taken as m, while the body's mass and "
        )
        text += f'moments suit as many km; write "{number} km" if that is meant, "{number} m" if not'
        yield Caution(WarningCode.LENGTH_WITHOUT_UNIT, text)
