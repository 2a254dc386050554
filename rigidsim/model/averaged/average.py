"""An averaged motion: what it averages over, whether it applies, its constants, and its start.

The full motion starts at a point of a nodding, wobbling curve, and the averaged one on the middle of that
curve: the terms removed by averaging are subtracted to first order. Otherwise an offset of the nutation's
size would remain, and change the rate of precession with it (the osculating and mean elements of Kinoshita
1977).

**Frequencies that forbid it.** Averaging over the rotation fails where a combination i g + j l + k n of the
body's precession and wobble (see ``free_motion``) with a source's mean motion is slow enough for its angle to
librate or to dwell. With the harmonic's part U of the potential energy the angle obeys phi'' = -(c U) sin phi
with c about (|i| + |j|)^2 over the least moment, so that within 2 sqrt(c U) of zero it librates (Chirikov
1979), and it swings the momentum by U / (L nu) elsewhere. Resonances may be too slow for the windows of a run
over which its error is measured (``rigidsim.accuracy.modelling``); whatever else makes an average bad is seen
there.

**Torques of the body alone**, whose polhode is followed ahead of the run. The mean torques change P and Q
(see ``free_motion``) whatever the momentum's direction. At the start both are those of the full motion less
their periodic terms, to first order in the torques; so is the direction. How far the average is off is
measured in windows of the run; what windows can't see are resonances between them. A combination i g + j l of
the body's precession and wobble that passes a multiple k n of a source's mean motion, or zero, turns the
momentum by

    (a / L) sqrt(2 pi / abs(d(i g + j l)/dt)),

a being the harmonic's torque across the momentum, (abs(i) + abs(j)) times its energy for a gradient
(stationary phase; Neishtadt 1975), in a direction that depends on an angle which no average carries: an error
that is announced. If the frequency changes by less than the angle accelerates, the angle may be captured
(Goldreich & Peale 1966), and the average is refused.

A torque of the body alone has a mean along the momentum and one that does work, which change P and Q; across
the momentum it goes round with the precession and has no mean. A viscous torque takes closed means, of whose
matrix the products about two axes vanish:

    Q' = -Q (d1 / I1 (1 - S) + d2 / I2 S),   P' = -P (d3 / I3 (1 - k^2 S) + k^2 d2 / I2 S),   S = <sin^2 f>

with the coefficients d about the principal axes. Any other is summed over nodes of f.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem, ensure, required
from rigidsim.model.averaged.free_motion import (
    ORDERS,
    FreeMotion,
    Polhodes,
    Separatrix,
    Wobble,
    along_polhode,
    free_motion,
    mean_square_sine,
    means_needed,
    parameter_of,
)
from rigidsim.model.averaged.sources import Resonance, SlowStart, Source, nutation, sources_of, unit
from rigidsim.model.averaged.tides import Tides, described, tides_of
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Carrier, Mechanics, carried_beside
from rigidsim.model.orbits import Carried
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, ScaledNumbers, Scaling, scaled_numbers
from rigidsim.model.state_blocks import BODY
from rigidsim.model.two_part import as_factor
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, negligible, norm, working_bits
from rigidsim.scene.choices import MEAN, ORBIT_AVERAGED
from rigidsim.scene.readable import span_text
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import surfaces_of

LIBRATION = 2.0
"""Least distance of a frequency combination from zero, in half-widths of libration: motions near the
separatrix dwell, and the widths of neighbouring resonances add up.
"""

AXIAL = 0.1
"""Angle (rad) between momentum and circled axis up to which that axis has a mean direction: it is along the
momentum, and the whole angle is part of what averaging leaves out.
"""
SWING = 0.05
"""Largest angle (rad) by which a resonance may swing the momentum: errors are of second order in it, and
beyond it a percent of the precession would be the best to hope for.
"""
_FULL = 'choose level = "full"'
_WEAK = 1e-7  # of the largest harmonic
PASSING = -math.log(_WEAK)
"""Least ratio of the body's frequencies to the angular rate w of a source that passes by, whose torque has a
spectrum that falls like exp(-nu / w): its singularities in complex time are within 1 / w of the real axis.
"""


def refuse_scene(scene: Scene, loads: Sequence[Load]) -> None:
    """Raise a ConfigError for a scene that is of no kind that has averages."""
    config, level, integrator = scene.config, scene.config.model.level, scene.config.integrator
    over_orbits, moments = level == ORBIT_AVERAGED, scene.body.principal_moments
    sources = [source for load in loads if (source := load.gradient_source) is not None]
    alone = [load for load in loads if load.gradient_source is None]
    unfit = [load.unaveraged for load in loads if load.unaveraged is not None]
    odd = [load.title for load in alone if not reads_rates_alone(load)]
    kinks = surfaces_of(scene).found if alone and not odd else []
    places = [source.placement for source in sources if over_orbits]
    unsuited = [x.name for x in places if not (any(x.elements()) or x.rests)]
    said = [
        (scene.free_flight, "the body has a position and flies", ""),
        (carried_beside(loads), carried_beside(loads), ""),
        *((True, what, f"{instead}, or {_FULL}") for what, instead in unfit),
        (not loads, "no torque acts, so that the direction of the angular momentum rests", ""),
        (max(moments) == min(moments), "a body whose moments are all the same has no torque to average", ""),
        *((over_orbits, f"{load.title} is no gravity gradient, and is averaged over the rotation alone",
           'choose "spin_averaged"') for load in alone),
        *((True, f"{title} is neither the gravity gradient of a source with elements, a place or an "
           "ephemeris, nor of one of [[bodies]], nor a function of the rates in body axes", "")
          for title in odd),
        *((True, f"{kink.text} ({kink.where}) has a kink or jump, over which no average is smooth", "")
          for kink in kinks),
        (all(w == 0 for w in scene.angular_velocity), "the body starts at rest", ""),
        (integrator.formulation != "auto",
         f'[integrator] formulation = "{integrator.formulation}" carries every rotation',
         f"leave it out, or {_FULL}"),
        (not integrator.has_steps,
         f'[integrator] method = "{integrator.method}" is of the full motion', f"leave it out, or {_FULL}"),
        (integrator.hold_invariants is True,
         "[integrator] hold_invariants = true is for the full motion's", f"set it to false, or {_FULL}"),
        (integrator.accuracy is not None or integrator.accuracy_position is not None,
         "[integrator] accuracy is the attitude's, which needs every rotation", ""),
        (config.events, "[[events]] read the full state", f"remove them, or {_FULL}"),
        (scene.states, "[[states]] go with every rotation", f"remove them, or {_FULL}"),
        (config.output.lyapunov, "[output] lyapunov is of the full motion", f"set it to false, or {_FULL}"),
        (scene.bodies is not None and scene.bodies.full,
         'coupling = "full" makes the bodies feel every rotation of this one',
         f'set [body] coupling to "one_way", or {_FULL}'),
        *((True, f"the source {name or 'by series'} has no elements to average over",
           'choose "spin_averaged", or give it an orbit by elements or a table') for name in unsuited),
    ]  # fmt: skip
    for holds, against, remedy in said:
        ensure(not holds, refused(level, against, remedy or _FULL))
    if alone and config.model.short_period:
        refuse_short_period(f"what {alone[0].title} does within a rotation")


def reads_rates_alone(load: Load) -> bool:
    """Whether a load is a function of the body's rates, in body axes, that doesn't depend on time."""
    placed = load.orbit or load.table or load.has_source
    return not (load.reads or placed or load.reacts or isinstance(load, Carrier))


def refuse_short_period(what: str) -> None:
    """Raise a ConfigError for terms that can't be added back."""
    raise ConfigError(
        Problem("[model] short_period", f"given true, but {what} isn't added back; set it to false")
    )


def refuse_frequencies(
    scene: Scene,
    wobble: Wobble,
    sources: Sequence[Source],
    moving: tuple[Wobble, float] | None = None,
    remedy: str = _FULL,
) -> None:
    """Refuse a motion whose frequencies aren't far enough apart, with a ConfigError that names the resonance.

    A rotation that torques change comes with the one at another time, and the seconds between (``moving``):
    resonances that it passes too fast to be captured are no reason to refuse it.
    """
    for source in sources:
        _refuse_resonance(scene, wobble, source, moving, None, remedy)


def kept_resonance(
    scene: Scene, wobble: Wobble, sources: Sequence[Source], motion: FreeMotion
) -> Resonance | None:
    """The resonance that an average over the orbits keeps, if any; raises as ``refuse_frequencies``."""
    found = [
        _refuse_resonance(scene, wobble, source, None, _offered(scene, motion, source), _FULL)
        for source in sources
    ]
    kept = [resonance for resonance in found if resonance is not None]
    names = [f"number {resonance.source.number} ({resonance.name})" for resonance in kept]
    ensure(
        len(kept) <= 1,
        refused(
            scene.config.model.level, f"the body is in resonance with [[loads]] {' and '.join(names)} at once"
        ),
    )
    if kept and scene.config.model.short_period:
        refuse_short_period(f"in resonance with [[loads]] {names[0]} what goes round with that orbit")
    return kept[0] if kept else None


def _refuse_resonance(
    scene: Scene,
    wobble: Wobble,
    source: Source,
    moving: tuple[Wobble, float] | None,
    offered: Resonance | None,
    remedy: str,
) -> Resonance | None:
    """Refuse resonances; return the one that is offered, if it is the only one and is met."""
    level = scene.config.model.level
    sizes, i, j, body = wobble.strong(_WEAK)
    if source.passing_rate is not None and source.motion == 0:
        slowest = min(abs(body).min(initial=math.inf), abs(wobble.rates[0]))
        if slowest < PASSING * source.passing_rate:
            raise refused(
                level,
                f"the point mass of [[loads]] {source.name} isn't bound to the body and passes it, by "
                f"their motion at the start, at {source.passing_rate:.3g} rad/s, which the body's "
                f"slowest frequency, {slowest:.3g} rad/s, has to exceed by a factor of {PASSING:.0f}",
                remedy,
            )
    if not len(sizes):
        return None
    orbit = source.harmonics
    k = np.flatnonzero(orbit > _WEAK * orbit.max())
    energy = float(source.strength) * sizes[:, None] * orbit[None, k]
    width = 2 * np.sqrt(
        (np.abs(i) + np.abs(j))[:, None] ** 2
        * energy
        / wobble.moments.min(where=wobble.moments > 0, initial=math.inf)
    )
    rate = np.abs(np.abs(body[:, None]) - k[None, :] * source.motion)
    swing = energy / (wobble.size * np.maximum(rate, 1e-300))
    slow = LIBRATION * width + 2 * source.slow_rate + 2 * source.uncertainty * k[None, :]
    if moving is not None:
        other, seconds = moving
        drift = np.abs(np.abs(i * other.rates[0] + j * other.rates[1]) - np.abs(body))[:, None] / seconds
        passes = drift > (width / 2) ** 2
        kick = energy / wobble.size * np.sqrt(2 * np.pi / np.maximum(drift, 1e-300))
        slow, swing = np.where(passes, 0.0, slow), np.where(passes, np.minimum(swing, kick), swing)
    met = False
    if offered is not None:
        spin = 2 * wobble.size / wobble.moments[2]
        of_spin = (i == 2) & (np.abs(np.abs(body) - spin) < abs(wobble.rates[1]))
        own = of_spin[:, None] & (k == offered.multiple)[None, :]
        met = bool((own & ((rate < slow) | (swing > SWING))).any())
        if met and level == ORBIT_AVERAGED:
            # the average keeps the body's axes and the momentum, so that it keeps its wobble as well
            held = (2 * k[None, :] == i[:, None] * offered.multiple) & (rate < source.motion / 2)
            slow, swing = np.where(held, 0.0, slow), np.where(held, 0.0, swing)
        elif met:
            remedy = 'choose level = "orbit_averaged", which keeps its angle, or "full"'
    if (rate < slow).any() or swing.max() > SWING:
        worst = np.unravel_index(int(np.argmax(slow / np.maximum(rate, 1e-300))), rate.shape)
        if not rate[worst] < slow[worst]:
            worst = np.unravel_index(int(np.argmax(swing)), rate.shape)
        at = int(i[worst[0]]), int(j[worst[0]]), int(k[worst[1]])
        period = span_text(2 * np.pi / rate[worst]) if rate[worst] > 0 else "forever"
        raise refused(
            level,
            f"{_combination(at, float(body[worst[0]]))} of the body's precession g and wobble l "
            f"and of the mean motion n of [[loads]] {source.name} is only "
            f"{float(rate[worst]):.3g} rad/s, once in {period}, where its angle "
            f"librates within {float(width[worst]):.3g} rad/s: a resonance, which no average may pass over",
            remedy,
        )
    return offered if met else None


def _offered(scene: Scene, motion: FreeMotion, source: Source) -> Resonance | None:
    """Nearest spin-orbit resonance with a source on a Kepler orbit, for rotation about axis 3; or None."""
    least, middle, most = motion.moments
    axial = least < middle < most and motion.tilt(scene.context) <= AXIAL
    if source.of.orbit is None or not axial:
        return None
    multiple = round(2 * float(motion.momentum / most) / source.motion)
    return Resonance(motion, source, multiple, scene.context) if multiple > 0 else None


def _combination(orders: tuple[int, int, int], body: float) -> str:
    """A combination of frequencies as text ("2 g - 2 l - 3 n"); g alone turns a symmetric body's tensor."""
    i, j, k = orders
    signed = -k if body > 0 else k
    terms = [(i, "g"), (j, "l"), (signed, "n")]
    signed_terms = [
        f"{'+' if c > 0 else '-'} {abs(c) if abs(c) != 1 else ''}{name}" for c, name in terms if c
    ]
    return " ".join(signed_terms).removeprefix("+ ")


def refused(level: str, against: str, remedy: str = _FULL) -> ConfigError:
    """The error for an average that doesn't apply."""
    return ConfigError(Problem("[model] level", f'given "{level}", but {against}; {remedy}'))


# --- torques of the body alone ------------------------------------------------------------------------------

EPSILON = 2.0**-60
"""Error that mean torques are worked out to in double precision and below; in higher ones 2^-7 epsilon."""
PARAMETER = 0.98
"""Largest k^2 over whose polhodes torques are averaged."""
_STEP = 0.05  # of the time in which P or Q change by their own size
_NEGLIGIBLE = 1e-7  # of the momentum: a wobble that no longer sets the step, but for stability
_NEAR = 1e-3  # of a step: how exactly the time of reaching the separatrix is reported
_NOTHING = 1e-150  # of the momentum at the start, whose square doubles still hold
_MOST_STEPS = 20_000
_NODES = 256
_PLACES = 48  # along the course, at which resonances are looked for
_WEAKEST = 1e-9  # of the largest moment, and of the largest harmonic of an orbit
_SEPARATRIX = (
    "the average isn't valid near the separatrix, the rotation about the intermediate axis, where the wobble "
    "takes forever, and the torques bring the body there"
)
RATE_STATES = BODY.rates
_CLOCK = "t_of_torque"
_FEWEST_NODES, _MOST_NODES = 8, 1024
_CHECKED = 1e-12
"""Relative difference between sums over n and over 2 n nodes, in double precision, at which n are taken to
resolve a torque whose smoothness isn't known.
"""
_BITS_CHECKED = 40


@dataclass(frozen=True)
class DrivingTorques:
    """The torques of a body alone, as functions of its rates; damping is d (mpf) about principal axes."""

    scene: Scene
    scaling: Scaling
    numbers: ScaledNumbers
    polhodes: Polhodes
    damping: Vector
    others: Sequence[Load]

    @classmethod
    def of(
        cls, scene: Scene, scaling: Scaling, numbers: ScaledNumbers, polhodes: Polhodes, loads: Sequence[Load]
    ) -> Self:
        """The torques of these loads."""
        context, others = scene.context, []
        damping = [context.zero] * 3
        for load in loads:
            coefficients = load.damping()
            if coefficients is None:
                others.append(load)
                continue
            for i, axis in enumerate(polhodes.axes):
                damping[i] += sum(c * a * a for c, a in zip(coefficients, axis, strict=True))
        return cls(scene, scaling, numbers, polhodes, damping, others)

    @cached_property
    def _moments(self) -> Vector:
        """Principal moments, internal units."""
        return [self.scene.context.ldexp(x, -self.scaling.inertia) for x in self.polhodes.moments]

    @cached_property
    def _decay(self) -> Vector:
        """d / I about the principal axes, per internal unit of time."""
        unit = self.scaling.time
        pairs = zip(self.damping, self.polhodes.moments, strict=True)
        return [self.scene.context.ldexp(d / i, unit) for d, i in pairs]

    def _along_axes(self, number: Rounder) -> list[Symbolic]:
        """Torque of the other loads along the principal axes, in ``RATE_STATES``, internal units."""
        terms = self._mechanics(number).torque
        found = []
        for axis in self.polhodes.axes:
            shares = [(dot(axis, vector), expression) for vector, expression in terms]
            parts = [as_factor(number(share)) * expression for share, expression in shares if share != 0]
            found.append(hy.sum(parts))
        return found

    def _mechanics(self, number: Rounder) -> Mechanics:
        return Mechanics(
            self.scene, self.scaling, self.numbers, list(hy.make_vars(*RATE_STATES)), None, None, None, None,
            number, loads=list(self.others),
        )  # fmt: skip

    @property
    def varies(self) -> str:
        """Why they aren't functions of the rates alone; empty if they are."""
        bare, clock = self._mechanics(float), hy.make_vars(_CLOCK)
        if any(load.extra_states(bare) is not None for load in self.others):
            return "a load has states"
        torque = (hy.subs(x, {hy.time: clock}) for x in self._along_axes(float))
        return "a torque depends on time" if any(_CLOCK in hy.get_variables(x) for x in torque) else ""

    # --- in double precision --------------------------------------------------------------------------------

    @cached_property
    def _evaluated(self) -> Any:
        found = self._along_axes(float)
        return hy.cfunc(found, list(hy.make_vars(*RATE_STATES)), compact_mode=True, opt_level=0)

    def at(self, momentum: np.ndarray) -> np.ndarray:
        """Torque (3, n) along the principal axes for a momentum (3, n) along them, internal units."""
        moments = np.array(self._moments, dtype=float)[:, None]
        torque = -np.array(self._decay, dtype=float)[:, None] * momentum
        if self.others:
            axes = np.array(self.polhodes.axes, dtype=float)
            rates = np.ascontiguousarray(axes.T @ (momentum / moments))
            torque = torque + self._evaluated(rates)
        return np.asarray(torque)

    def nodes(self, amplitudes: np.ndarray, epsilon: float) -> int:
        """Nodes for sums over f that err by less than epsilon for all these amplitudes.

        More and more until sums over twice as many agree in double precision, which measures how smooth
        torque and weight are, and in proportion to the digits beyond.

        Raises:
            ArithmeticError: a torque that too many nodes don't resolve.
        """
        if not self.others:
            return 0
        count, around = _FEWEST_NODES, 2 * np.pi * np.arange(_NODES) / _NODES
        # of what is averaged: a mean may vanish
        scale = max(float(np.abs(self.change(p, q, around)[0]).max()) for p, q in amplitudes)
        while count <= _MOST_NODES:
            pairs = [(self.mean(p, q, count), self.mean(p, q, 2 * count)) for p, q in amplitudes]
            if all(float(np.abs(x - y).max()) <= _CHECKED * scale for x, y in pairs):
                more = -np.log2(epsilon) / _BITS_CHECKED
                return int(np.ceil(count * max(1.0, more)))
            count += count // 4
        raise ArithmeticError

    def wobble(self, axial: float, transverse: float, amplitude: float = 0.0) -> Wobble:
        """The rotation of these amplitudes, internal units."""
        return Wobble(self._moments, axial, transverse, amplitude)

    def parameter_at(self, amplitudes: np.ndarray) -> float:
        """k^2 at amplitudes P and Q."""
        return parameter_of(float(self.polhodes.ratio), float(amplitudes[0]), float(amplitudes[1]))

    def across(self, wobble: Wobble) -> np.ndarray:
        """Torque across the momentum, x + i y in the frame that precesses, (points,)."""
        turned = np.einsum("nab,bn->an", wobble.turns, self.at(wobble.momentum))
        return np.asarray(turned[0] + 1j * turned[1])

    def change(self, axial: float, transverse: float, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """P' and Q', (2, n), at amplitudes f, per internal unit of time, and dn, (n,)."""
        ratio, root = float(self.polhodes.ratio), float(self.polhodes.root)
        momentum, delta = along_polhode(ratio, axial, transverse, angle)
        torque, share = self.at(momentum), (1 - ratio) * transverse / axial if ratio != 1 else 0.0
        along = torque[2] * delta + share * torque[1] * np.sin(angle)
        return np.array([along, torque[0] * np.cos(angle) / root + torque[1] * np.sin(angle)]), delta

    def mean(self, axial: float, transverse: float, count: int) -> np.ndarray:
        """Means of P' and Q' over a polhode, (2,), by a sum over nodes."""
        slopes, delta = self.change(axial, transverse, 2 * np.pi * (np.arange(count) + 0.5) / count)
        return np.asarray(slopes @ (1 / delta) / (1 / delta).sum())

    # --- as expressions -------------------------------------------------------------------------------------

    def rates(
        self, axial: Symbolic, transverse: Symbolic, number: Rounder, nodes: int, sines: Symbolic
    ) -> list[Symbolic]:
        """P' and Q' as expressions of P and Q, per internal unit of time."""
        first, second, third = (as_factor(number(x)) for x in self._decay)
        parameter = self.parameter(axial, transverse, number)
        p = [-(axial * (third + parameter * sines * (second - third)))] if any(self.damping) else []
        q = [-(transverse * (first + sines * (second - first)))] if any(self.damping) else []
        if self.others:
            more = self._summed(axial, transverse, number, nodes)
            p.append(more[0])
            q.append(more[1])
        return [hy.sum(p), hy.sum(q)]

    def parameter(self, axial: Symbolic, transverse: Symbolic, number: Rounder) -> Symbolic:
        """k^2."""
        if self.polhodes.symmetric:
            return hy.expression(0.0)
        tangent = transverse / axial
        return as_factor(number(1 - self.polhodes.ratio)) * (tangent * tangent)

    def mean_square(
        self, axial: Symbolic, transverse: Symbolic, number: Rounder, largest: float, epsilon: float
    ) -> Symbolic:
        """<sin^2 f>, for parameters up to the largest given."""
        if self.polhodes.symmetric:
            return hy.expression(0.5)
        means = means_needed(largest, epsilon)
        return mean_square_sine(self.parameter(axial, transverse, number), hy.sqrt, means)

    def _summed(
        self, axial: Symbolic, transverse: Symbolic, number: Rounder, nodes: int
    ) -> tuple[Symbolic, Symbolic]:
        context, polhodes = self.scene.context, self.polhodes
        torque = self._along_axes(number)
        states = list(hy.make_vars(*RATE_STATES))
        tangent = transverse / axial
        weights, along, across = [], [], []
        for j in range(nodes):
            angle = 2 * context.pi * (j + context.one / 2) / nodes
            c, s = context.cos(angle), context.sin(angle)
            factor = as_factor(number((1 - polhodes.ratio) * s * s))
            delta = hy.sqrt(hy.expression(1.0 - factor * (tangent * tangent)))
            shares = [polhodes.root * c / self._moments[0], s / self._moments[1], 1 / self._moments[2]]
            sizes = [transverse, transverse, axial * delta]
            rates = {
                state: hy.sum(
                    [
                        as_factor(number(share * axis[i])) * size
                        for share, size, axis in zip(shares, sizes, polhodes.axes, strict=True)
                        if share * axis[i] != 0
                    ]
                )
                for i, state in enumerate(states)
            }
            first, second, third = hy.subs(torque, rates)
            weight = 1.0 / delta
            weights.append(weight)
            share = as_factor(number((1 - polhodes.ratio) * s)) * tangent
            along.append(third + weight * (share * second))
            turned = as_factor(number(c / polhodes.root)) * first + as_factor(number(s)) * second
            across.append(weight * turned)
        whole = hy.sum(weights)
        return hy.sum(along) / whole, hy.sum(across) / whole


# --- what they do along a run -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Driven:
    """What torques of the body alone do to an averaged motion; mpf, SI, but for floats."""

    titles: Sequence[str]
    polhodes: Polhodes
    torques: DrivingTorques
    axial: Any
    transverse: Any
    amplitude: float  # f at the start, rad
    epsilon: float
    direction: np.ndarray  # periodic part of the momentum's direction at the start
    times: np.ndarray  # along the run, internal units
    course: np.ndarray  # P and Q at these times, (times, 2), internal units
    fastest: float  # largest rate at which torques change P, Q or the momentum, relative to their sizes
    nodes: int
    passed: float  # sum of the angles (rad) by which resonances turn the momentum

    @property
    def parameter(self) -> float:
        """Largest k^2."""
        return max(self.torques.parameter_at(place) for place in self.course)

    @property
    def least(self) -> float:
        """Smallest size of the momentum over the one at the start."""
        sizes = np.hypot(self.course[:, 0], float(self.polhodes.root) * self.course[:, 1])
        return float(sizes.min() / sizes[0])

    @property
    def tilt(self) -> float:
        """Largest angle (rad) between the momentum and the circled axis."""
        axial, transverse = self.course.T
        sines = np.abs(transverse) / np.hypot(axial, float(self.polhodes.root) * transverse)
        return float(np.arcsin(np.minimum(sines, 1.0)).max())

    def states(self, exponent: int) -> Vector:
        """Initial P and Q in internal units of angular momentum, 2^exponent kg m^2/s."""
        context = self.torques.scene.context
        return [context.ldexp(x, -exponent) for x in (self.axial, self.transverse)]

    def momentum(self, axial: Any, transverse: Any) -> Vector:
        """Angular momentum, body axes, where f is as at the start, on the polhode of amplitudes P and Q."""
        context = self.torques.scene.context
        turn = context.mpf(self.amplitude)
        return self.polhodes.momentum(context, axial, transverse, context.cos(turn), context.sin(turn))

    def motion(self, axial: Any, transverse: Any) -> FreeMotion:
        """Free motion on the polhode of amplitudes P and Q."""
        scene = self.torques.scene
        return free_motion(scene.context, scene.body, self.momentum(axial, transverse))

    def detuned(self, motion: FreeMotion, size: float, shape: float) -> float:
        """Change of ``FreeMotion.excess`` over the momentum (s), to which precession is in proportion, by
        relative errors of the momentum's size and of the energy over its square.
        """
        first, _, third = (float(x) for x in self.polhodes.moments)
        length, ratio = float(motion.momentum), float(self.polhodes.ratio)
        across = float(motion.amplitudes[0]) ** 2
        twice = length**2 * (across / first + (1 - across) / third)
        found = []
        for i, j in ((0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)):
            whole, other = (length * (1 + i * size)) ** 2, twice * (1 + i * size) ** 2 * (1 + j * shape)
            turned = min(max((other - whole / third) / (1 / first - 1 / third), 0.0), whole)
            if ratio != 1:  # no further than averages go
                turned = min(turned, whole / (1 + (1 - ratio) / (ratio * PARAMETER)))
            moved = Wobble(self.polhodes.moments, math.sqrt(whole - turned), math.sqrt(turned / ratio))
            found.append(moved.excess / moved.size)
        return max(abs(x - found[0]) for x in found[1:])


def driven_by(
    scene: Scene,
    scaling: Scaling,
    loads: Sequence[Load],
    sources: Sequence[Source],
    epsilon: float,
    *,
    known: bool,
) -> Driven:
    """What these loads, functions of the rates, do to a body that turns as the scene starts.

    Args:
        known: whether the resonances that it passes were looked for in a motion that this is a part of.

    Raises:
        Separatrix: the body turns about its intermediate axis.
        ConfigError: their average doesn't apply, or a resonance can't be passed over.
    """
    context, exponent, level = scene.context, scaling.momentum, scene.config.model.level
    momentum = apply(scene.body.inertia, scene.angular_velocity)
    polhodes = Polhodes.of(context, free_motion(context, scene.body, momentum))
    torques = DrivingTorques.of(scene, scaling, scaled_numbers(scene, scaling), polhodes, loads)
    if varies := torques.varies:
        varies += ", and only torques that are functions of the rates about the body axes are averaged"
        raise refused(level, varies)
    first, second, third = (dot(axis, momentum) for axis in polhodes.axes)
    across = context.sqrt((first / polhodes.root) ** 2 + second**2)
    axial = third * context.sqrt(1 + (1 - polhodes.ratio) * (second / third) ** 2) if third else third
    amplitude = math.atan2(float(second), float(first / polhodes.root)) if across != 0 else 0.0
    start = [float(context.ldexp(x, -exponent)) for x in (axial, across)]
    wobble = torques.wobble(start[0], start[1], amplitude)
    change, _ = torques.change(start[0], start[1], wobble.amplitudes)
    removed = wobble.removed(change, 0, float(np.abs(change).max())).real
    direction = np.zeros(3)
    if np.isfinite(removed).all():  # what isn't is refused below
        direction = _direction_removed(scene, torques, wobble, momentum)
        axial -= context.ldexp(context.mpf(float(removed[0])), exponent)
        across -= context.ldexp(context.mpf(float(removed[1])), exponent)
        start = [float(context.ldexp(x, -exponent)) for x in (axial, across)]
    begin, end = (float(scaling.internal(x, context)) for x in (scene.start, scene.end))
    times, course, fastest, failure = _followed(torques, np.array(start), begin, end)
    if failure:
        until, what = float(scaling.seconds(times[-1])), f'given "{level}", but {failure}'
        if len(times) > 1:
            what += f" after {until:.6g} s ({span_text(until)}): end the run by then, or"
        raise ConfigError(Problem("[model] level", what + ' choose level = "full"'))
    fineness = min(EPSILON, epsilon / 128)
    try:
        nodes = torques.nodes(course[:: max(1, len(course) // 8)], fineness)
    except ArithmeticError:
        raise refused(
            level, "a torque changes too abruptly with the rates to be averaged over them"
        ) from None
    passed = 0.0 if known else _passed(scene, torques, sources, times, course)
    titles = list(dict.fromkeys(load.title for load in loads))
    given = axial, across, amplitude, fineness, direction, times, course, fastest, nodes, passed
    return Driven(titles, polhodes, torques, *given)


def _followed(
    torques: DrivingTorques, now: np.ndarray, begin: float, end: float
) -> tuple[np.ndarray, np.ndarray, float, str]:
    """Internal times, amplitudes and the fastest relative rate, by Runge-Kutta steps of the fourth order, and
    what ended them before the run's end.
    """
    way = torques.scaling.direction
    time, fastest, part, failure = begin, 0.0, 1.0, ""
    times, amplitudes, initial = [time], [now], float(np.linalg.norm(now))
    if not torques.parameter_at(now) < 1:  # where strong torques leave it, less their periodic part
        return np.array(times), np.array(amplitudes), fastest, _SEPARATRIX

    def rate(state: np.ndarray) -> np.ndarray:
        return way * torques.mean(float(state[0]), float(state[1]), _NODES)

    while time < end and not failure:
        first = rate(now)
        size = float(np.linalg.norm(now))
        relative = np.abs(first) / np.maximum(np.abs(now), _NEGLIGIBLE * size)
        speed = np.where(np.abs(now) > _NEGLIGIBLE * size, relative / _STEP, relative)
        fastest = max(fastest, float(np.linalg.norm(first)) / size, float(relative.max()))
        step = part * min(end - time, 1 / float(speed.max()) if speed.max() > 0 else end - time)
        with np.errstate(invalid="ignore"):  # beyond the separatrix, which is looked at below
            second = rate(now + step / 2 * first)
            third = rate(now + step / 2 * second)
            fourth = rate(now + step * third)
        later = now + step / 6 * (first + 2 * second + 2 * third + fourth)
        if not np.isfinite(later).all() or torques.parameter_at(later) > PARAMETER:
            part /= 2
            if part < _NEAR and torques.parameter_at(now + step * first) > PARAMETER:
                failure = _SEPARATRIX
            elif part < _NEAR:
                failure = "a torque has no finite value somewhere in the averaged rotation"
            continue
        time = end if step >= end - time else time + step
        now = later
        times.append(time)
        amplitudes.append(now)
        if float(np.linalg.norm(now)) < _NOTHING * initial:
            failure = "the torques bring the body to rest"
        elif len(times) > _MOST_STEPS:
            failure = "the torques change the motion too often to be followed ahead of the run"
    return np.array(times), np.array(amplitudes), fastest, failure


def _direction_removed(scene: Scene, torques: DrivingTorques, wobble: Wobble, momentum: Vector) -> np.ndarray:
    """Periodic part of the momentum's direction at the start, space axes."""
    across = torques.across(wobble) / wobble.size
    scale = float(np.abs(across).max())
    found = complex(wobble.removed(across, 1, scale, 1 / SWING))  # what stands still is passed, or refused
    body = np.array(attitude.rotation_matrix(scene.quaternion), dtype=float)
    length = norm(scene.context, momentum)
    space = frame_along(body @ np.array([float(x / length) for x in momentum]))
    principal = np.array(torques.polhodes.axes, dtype=float).T
    turn = wobble.precessed(space @ body @ principal)
    found *= complex(math.cos(turn), math.sin(turn))
    return np.asarray(space.T @ np.array([found.real, found.imag, 0.0]))


def frame_along(z: np.ndarray) -> np.ndarray:
    """Right-handed orthonormal axes as rows, z last."""
    z = z / np.linalg.norm(z)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x), z])


# --- resonances that are passed -----------------------------------------------------------------------------


def _passed(
    scene: Scene, torques: DrivingTorques, sources: Sequence[Source], times: np.ndarray, course: np.ndarray
) -> float:
    """Sum of the angles by which passages turn the momentum; raises a ConfigError that names the first
    resonance that can't be passed over, and when it is met.
    """
    scaling, total = torques.scaling, 0.0
    places = np.linspace(times[0], times[-1], _PLACES)
    seconds = scaling.seconds(places)
    apart = abs(float(seconds[1] - seconds[0]))
    polhodes = np.array([np.interp(places, times, amplitude) for amplitude in course.T]).T
    own = [torques.wobble(*polhode) for polhode in polhodes]
    moments = torques.polhodes.moments
    wobbles = [Wobble(moments, *np.ldexp(polhode, scaling.momentum)) for polhode in polhodes]
    for n, wobble in enumerate(wobbles):
        later = (
            f", or end the run before {span_text(seconds[n])}, when torques of the body alone bring it there"
        )
        remedy = f'choose level = "full"{later if n else ""}'
        beside = wobbles[n + 1] if n + 1 < _PLACES else wobbles[n - 1]
        refuse_frequencies(scene, wobble, sources, (beside, apart), remedy)
        if n + 1 == _PLACES:
            break
        kicks = [_own_kick(torques, own[n], own[n + 1], float(places[1] - places[0]))]
        kicks += [_kick(wobble, beside, source, apart) for source in sources if source.motion != 0]
        total += sum(kicks)
        if total > SWING:
            captured = (
                "may be captured in" if math.isinf(total) else f"is turned by {total:.2g} rad by passing"
            )
            raise refused(scene.config.model.level, f"the rotation {captured} a resonance", remedy)
    return total


def _own_kick(torques: DrivingTorques, before: Wobble, after: Wobble, apart: float) -> float:
    """Angle by which combinations g + j l that pass zero turn the momentum."""
    sizes = np.abs(np.fft.fft(torques.across(before)) / len(ORDERS)) / before.size
    first, last = (wobble.rates[0] + ORDERS * wobble.rates[1] for wobble in (before, after))
    met = (first * last < 0) & (sizes > 0)
    return float((sizes[met] * np.sqrt(2 * np.pi * apart / np.abs(last - first)[met])).sum())


def _kick(before: Wobble, after: Wobble, source: Source, seconds: float) -> float:
    """Angle by which resonances with a source turn the momentum; infinite if one may capture it."""
    orbit, total = source.harmonics, 0.0
    sizes, i, j, first = before.strong(_WEAKEST)
    first, last = np.abs(first), np.abs(i * after.rates[0] + j * after.rates[1])
    low, high = (f(np.array([first, last]) / source.motion, axis=0) for f in (np.min, np.max))
    for n in np.flatnonzero(np.floor(high) >= np.ceil(low)):
        k = np.arange(int(np.ceil(low[n])), min(int(high[n]), len(orbit) - 1) + 1)
        energy = float(source.strength) * sizes[n] * orbit[k[orbit[k] > _WEAKEST * orbit.max()]]
        order, drift = float(i[n] + abs(j[n])), abs(float(first[n] - last[n])) / seconds
        if (order**2 * energy / before.moments.min() > drift).any():
            return math.inf
        total += float(order * energy.sum() / min(before.size, after.size)) * math.sqrt(2 * math.pi / drift)
    return total


# --- the average --------------------------------------------------------------------------------------------

_ROUNDS = 4  # iterations; each gains a factor of the nutation's size

DIRECTION = ["sx", "sy", "sz"]
"""States: direction of the momentum, space axes; its mean if nothing is added back."""
OBSERVABLES = (
    "angular_momentum", "angular_momentum_norm", "energy", "figure_axis", "spin_axis", "momentum_axis",
    "right_ascension", "declination", "obliquity", "node_longitude", "point_mass_position", "precession",
    "longitude_of_perihelion_of_date", "climatic_precession", "orbit_eccentricity", "insolation",
    "source_position", "tidal_distance",
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
    tides: Tides | None = None

    @property
    def over_orbits(self) -> bool:
        """Whether it averages over the sources' orbits as well."""
        return self.level == ORBIT_AVERAGED

    def provides(self, name: str) -> bool:
        """Whether it can provide an observable, as far as the scene has it."""
        turning = self.tides is not None and name in ("rotation_rate", "rotation_period")
        return name in OBSERVABLES or turning or (name == "resonant_angle" and self.resonance is not None)

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

    def tidal_words(self, scene: Scene, seconds: float) -> str | None:
        """The tidal model, and what the other would change within so many seconds; None without tides."""
        on_orbit = [source for source in self.sources if source.has_elements]
        if self.tides is None or not on_orbit:
            return None
        context, rates = scene.context, dict[int, float]()
        for source in self.sources:
            placed, e = source.of.placement, source.eccentricity
            rate = float(self.rate(source) * placed.node_factor(context))
            rates[source.number] = rate / 2 * (1 - e * e) ** -1.5
        cosine = float(dot(on_orbit[0].normal(context, scene.start), self.start))
        return described(self.tides, rates, cosine, seconds)

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
            found += 4 * self.resonance.strength * self.resonance.source.nearest / self.motion.momentum
            beyond = sum(abs(x) for x in required(self.slow).momentum)
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
        if scene.config.tides is not None and (alone or resonance is not None or not _figure(scene, motion)):
            what = "given for a body in resonance, under other torques, or one that tumbles; leave it out"
            raise ConfigError(Problem("[tides]", what))
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
    tides = tides_of(scene, sources, motion.momentum)
    found = Average(table.level, table.short_period, motion, sources, start, energy, figure, tides=tides)
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
