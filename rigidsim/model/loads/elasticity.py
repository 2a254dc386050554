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

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import heyoka as hy

from rigidsim.model.distortion import Distortion, SeenTide, total
from rigidsim.model.gradient import GradientSource
from rigidsim.model.inertia import ConstantInertia, MassDistribution
from rigidsim.model.kinematics import Kinematics, in_common_unit, inertia_times
from rigidsim.model.load import Load, Term, loads_of
from rigidsim.model.loads.elastic_keys import (
    ElasticEffects,
    about_keys,
    elastic_values,
    fault,
    refuse_delay,
)
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic, transpose
from rigidsim.model.rotations import apply as turned
from rigidsim.model.scaling import Scaling, source_rate
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Matrix, Vector, apply, dot, norm, working_epsilon
from rigidsim.scene.attitude import rotation_matrix
from rigidsim.scene.cautions import Caution
from rigidsim.scene.kernels.reading import Sight
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.tracing.numbers import plain

T = TypeVar("T")
_MOST = 0.1  # of a moment, up to which a linear response makes sense


@register_load(body="elasticity")
@dataclass(frozen=True)
class Elasticity(ElasticEffects, Load):
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

    @classmethod
    def brought_by(cls, config: Config) -> bool:
        return config.body.elasticity is not None

    @classmethod
    def resolve(cls, fields: Config, around: Setting) -> Elasticity:
        return cls(*elastic_values(fields, around))

    @cached_property
    def strength(self) -> Any:
        """k R^5 / G, kg s^2."""
        return self.love_number * self.radius**5 / self.radius.context.mpf(GRAVITATIONAL_CONSTANT)

    def acts(self) -> bool:
        return bool(self.love_number != 0 and (self.raising or self.spins))

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset({"attitude"} if self.raising else ())

    def sources(self, scene: Scene) -> list[GradientSource]:
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

    def _sizes(self, load: GradientSource, unit: Any, scaling: Scaling) -> tuple[Any, Any]:
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
            nearest = load.placement.nearest(context)
            tide = tide + self.strength * load.gravitational_parameter / nearest**3 / least
        return (spin + tide, 2 * spin) if self.spins else (tide, context.zero)

    def iterations(self, scene: Scene) -> int:
        """Of the rate without delay, until what is left is less than rounding."""
        distorted, factor = self.shares(scene)
        if distorted > _MOST:
            what = f"given numbers by which the tensor changes by up to {float(plain(distorted)):.3g} of the "
            what += f"least moment; up to {_MOST:g} is allowed, since the response is linear: check "
            raise fault("", what + "love_number, radius, and G M and distances of the sources")
        refuse_delay(plain(self.delay), self.turned_within(scene))
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
        yield from about_keys(fields, scene, plain(self.delay), self.turned_within(scene))

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
