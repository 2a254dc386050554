"""An averaged motion: what it averages over, its constants, and its start.

The full motion starts at a point of a nodding, wobbling curve, and the averaged one on the middle of that
curve: the terms removed by averaging are subtracted to first order. Otherwise an offset of the nutation's
size would remain, and change the rate of precession with it (the osculating and mean elements of Kinoshita
1977).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigidsim.model.averaged.applies import AXIAL, kept_resonance, refuse_scene, refused
from rigidsim.model.averaged.driven import Driven, driven_by, frame_along
from rigidsim.model.averaged.free_motion import FreeMotion, Separatrix, free_motion
from rigidsim.model.averaged.orbit_terms import nutation
from rigidsim.model.averaged.resonance import Resonance, SlowStart
from rigidsim.model.averaged.sources import Source, sources_of, unit
from rigidsim.model.averaged.wobble import Wobble
from rigidsim.model.load import Load
from rigidsim.model.orbits.prescribed import Carried
from rigidsim.model.scaling import Scaling
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, negligible, norm, working_bits
from rigidsim.scene.choices import MEAN, ORBIT_AVERAGED
from rigidsim.scene.scene import Scene

_ROUNDS = 4  # iterations; each gains a factor of the nutation's size

DIRECTION = ["sx", "sy", "sz"]
"""States: direction of the momentum, space axes; its mean if nothing is added back."""
OBSERVABLES = (
    "angular_momentum", "angular_momentum_norm", "energy", "figure_axis", "spin_axis", "momentum_axis",
    "right_ascension", "declination", "obliquity", "node_longitude", "point_mass_position", "precession",
    "longitude_of_perihelion_of_date", "climatic_precession", "orbit_eccentricity", "insolation",
    "source_position",
    "point_mass_velocity", "orbital_energy", "orbital_angular_momentum", "orbital_linear_momentum",
)  # fmt: skip
"""Observables that an averaged motion can provide, as far as the scene has them."""


@dataclass(frozen=True)
class Average:
    """An averaged motion; numbers are mpf, SI; if driven, ``motion`` and ``energy`` are the start's."""

    level: str
    short_period: bool
    motion: FreeMotion
    sources: Sequence[Source]
    start: Vector  # initial direction of the momentum, unit vector, space axes
    energy: Any
    figure: int  # +1 or -1 if the figure axis or its opposite is circled and stays near the momentum, else 0
    resonance: Resonance | None = None
    slow: SlowStart | None = None
    driven: Driven | None = None  # what torques of the body alone do

    @property
    def over_orbits(self) -> bool:
        """Whether it averages over the sources' orbits as well."""
        return self.level == ORBIT_AVERAGED

    def provides(self, name: str) -> bool:
        """Whether it can provide an observable, as far as the scene has it."""
        return name in OBSERVABLES or (name == "resonant_angle" and self.resonance is not None)

    @property
    def longitude(self) -> Carried:
        """Which longitude along a tabulated orbit the average needs."""
        if not self.over_orbits:
            return Carried.ECCENTRIC
        return Carried.MEAN if self.short_period else Carried.NEITHER

    def initial(self, exponent: int) -> Vector:
        """Initial states, a momentum in units of 2^exponent kg m^2/s."""
        if self.driven is not None:
            return [*self.start, *self.driven.states(exponent)]
        if self.resonance is None or self.slow is None:
            return list(self.start)
        momentum = [self.resonance.context.ldexp(x, -exponent) for x in self.slow.momentum]
        return [*self.slow.quaternion, *momentum]

    def rate(self, source: Source) -> Any:
        """Precession constant k = 3 (G M / a^3) excess / L (mpf, 1/s) of a source; see ``orbit_terms``."""
        return source.strength * self.motion.excess / self.motion.momentum

    @property
    def strength(self) -> float:
        """Largest rate of precession, averaged over orbits, per ``FreeMotion.excess`` / momentum, 1/s^2."""
        return sum(float(s.strength) * (1 - s.eccentricity**2) ** -1.5 / 2 for s in self.sources)

    @property
    def rate_bound(self) -> Any:
        """Bound of the rate at which the momentum turns, rad/s (mpf)."""
        if self.driven is not None:
            spread, unit = max(self.motion.moments) - min(self.motion.moments), self.driven.torques.scaling
            strength = sum((source.strength * source.nearest for source in self.sources), 0 * spread)
            own = math.ldexp(self.driven.fastest, -unit.time)
            return strength * spread / (self.motion.momentum * self.driven.least) + own
        found = sum(abs(self.rate(source)) * source.nearest for source in self.sources)
        if self.resonance is not None:
            assert self.slow is not None
            found += 4 * self.resonance.strength * self.resonance.source.nearest / self.motion.momentum
            beyond = sum(abs(x) for x in self.slow.momentum)
            found += 2 * self.resonance.libration_rate + beyond / self.motion.moments[0]
        return found

    def shear(self, context: Any, time: Any) -> Any:
        """Change of the precession rate per radian of tilt across it (mpf, 1/s), at the start ``time``: the
        sum of k/2 (1 - e^2)^(-3/2) |n x s|^2 over the sources.
        """
        total = context.zero
        for source in self.sources:
            size, square = abs(self.rate(source)) / 2, context.one
            if source.has_elements:
                size = abs(source.secular_strength(context) * self.motion.excess / self.motion.momentum)
                across = cross(source.normal(context, time), self.start)
                square = dot(across, across)
            total += size * square
        # as the momentum becomes smaller, it precesses faster
        return total if self.driven is None else total / self.driven.least


def average_of(
    scene: Scene, loads: Sequence[Load], scaling: Scaling, along: Average | None = None
) -> Average:
    """The averaged motion that a scene's ``[model] level`` asks for; ConfigError if it doesn't apply.

    ``along`` is the average whose motion has come to this scene's start: it is the same one from there, with
    its resonance, and its frequencies were checked where it began.
    """
    refuse_scene(scene, loads)
    context, body, table = scene.context, scene.body, scene.config.model
    matrix = attitude.rotation_matrix(scene.quaternion)
    momentum = apply(body.inertia, scene.angular_velocity)
    sources = sources_of(scene, loads)
    try:
        motion = free_motion(context, body, momentum)
        wobble = Wobble.of(motion, unit(context, momentum))
        alone = [load for load in loads if load.gradient_source is None]
        if along is not None:
            resonance = None if along.resonance is None else along.resonance.with_source_in(sources)
        else:
            resonance = None if alone else kept_resonance(scene, wobble, sources, motion)
        if resonance is not None:
            return _resonant(scene, resonance, sources)
        vector = apply(matrix, momentum)
        if table.start != MEAN:
            removed = _left_out_at_start(scene, motion, wobble, sources)
            vector = [x - context.mpf(float(y)) for x, y in zip(vector, removed, strict=True)]
        if alone:
            return _driven(scene, alone, sources, unit(context, vector), scaling, known=along is not None)
        motion = free_motion(context, body, momentum, norm(context, vector))
    except Separatrix:
        raise refused(
            table.level,
            "the body turns about its intermediate axis, where its wobble takes forever and nothing averages",
        ) from None
    start, energy = unit(context, vector), dot(momentum, scene.angular_velocity) / 2
    figure = _figure(scene, motion)
    found = Average(table.level, table.short_period, motion, sources, start, energy, figure)
    if found.over_orbits and table.start != MEAN:
        return replace(found, start=_mean_over_orbits(scene, found))
    return found


def _resonant(scene: Scene, resonance: Resonance, sources: Sequence[Source]) -> Average:
    context, level, motion = scene.context, scene.config.model.level, resonance.motion
    slow = resonance.start(scene)
    momentum = resonance.whole(slow)
    motion = replace(motion, momentum=norm(context, momentum))
    resonance = replace(resonance, motion=motion)
    start = unit(context, apply(attitude.rotation_matrix(slow.quaternion), momentum))
    energy = sum(x * x / i for x, i in zip(momentum, motion.moments, strict=True)) / 2
    figure = _figure(scene, motion)
    return Average(level, False, motion, sources, start, energy, figure, resonance, slow)


def _driven(
    scene: Scene,
    alone: Sequence[Load],
    sources: Sequence[Source],
    direction: Vector,
    scaling: Scaling,
    *,
    known: bool,
) -> Average:
    """The average under torques of the body alone as well."""
    context, level = scene.context, scene.config.model.level
    epsilon = 2.0 ** (1 - working_bits(scene.config.integrator.precision))
    driven = driven_by(scene, scaling, alone, sources, epsilon, known=known)
    start = [x - context.mpf(float(y)) for x, y in zip(direction, driven.direction, strict=True)]
    motion = driven.motion(driven.axial, driven.transverse)
    energy = driven.polhodes.energy(driven.axial, driven.transverse)
    figure, start = _figure(scene, motion) if driven.tilt <= AXIAL else 0, unit(context, start)
    return Average(level, False, motion, sources, start, energy, figure, driven=driven)


def _figure(scene: Scene, motion: FreeMotion) -> int:
    along = dot(scene.figure.pole, motion.axes[2])
    if abs(abs(along) - 1) > negligible(scene.context) or motion.tilt(scene.context) > AXIAL:
        return 0
    return 1 if along > 0 else -1


def _left_out_at_start(
    scene: Scene, motion: FreeMotion, wobble: Wobble, sources: Sequence[Source]
) -> np.ndarray:
    """Part of the initial momentum that averaging over the rotation removes, kg m^2/s, space axes."""
    body = np.array(attitude.rotation_matrix(scene.quaternion), dtype=float)
    momentum = apply(scene.body.inertia, scene.angular_velocity)
    space = frame_along(body @ np.array([float(x) for x in unit(scene.context, momentum)]))
    turn = wobble.precessed(space @ body @ np.array(motion.axes, dtype=float).T)
    integral = space.T @ wobble.removed_tensor(turn) @ space
    total = np.zeros(3)
    for source in sources:
        pull = source.pull_at_start(scene)
        if pull is not None:
            product = float(source.strength) * pull @ integral
            # r x (I r) is the sum over a, b of r_a r_b e_a x I e_b
            total += [product[i, j] - product[j, i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return total


def osculating(scene: Scene, average: Average, mean: Sequence[Any], time: Any) -> Vector:
    """Unit direction (mpf) of the momentum with the nutation of the orbits' periods, at a time in seconds."""
    context = scene.context
    found = list(mean)
    for source in average.sources if average.over_orbits else ():
        if source.has_elements:
            ellipse, place = source.ellipse(context, time), source.place(context, time)
            k = source.strength_at(context, time) * average.motion.excess / average.motion.momentum
            size = k / (2 * ellipse.motion * ellipse.root**3)
            more = nutation(context, ellipse, place, size, list(mean), lambda x: x)
            found = [x + y for x, y in zip(found, more, strict=True)]
    return unit(context, found)


def _mean_over_orbits(scene: Scene, average: Average) -> Vector:
    """Mean direction s for which s + nutation(s) is the start."""
    context, start = scene.context, average.start
    mean = start
    for _ in range(_ROUNDS):
        seen = osculating(scene, average, mean, scene.start)
        mean = unit(context, [m + x - y for m, x, y in zip(mean, start, seen, strict=True)])
    return mean
