"""An averaged motion under torques of the body alone: its polhode, followed ahead of the run, and resonances.

The mean torques change P and Q (see ``free_motion``) whatever the momentum's direction. At the start both are
those of the full motion less their periodic terms, to first order in the torques; so is the direction. How
far the average is off is measured in windows of the run; what windows can't see are resonances between them.
A combination i g + j l of the body's precession and wobble that passes a multiple k n of a source's mean
motion, or zero, turns the momentum by

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
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.averaged.applies import SWING, refuse_frequencies, refused
from rigidsim.model.averaged.free_motion import (
    FreeMotion,
    Polhodes,
    free_motion,
    mean_square_sine,
    means_needed,
    nodes_needed,
)
from rigidsim.model.averaged.sources import Source
from rigidsim.model.averaged.wobble import ORDERS, Wobble
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, ScaledNumbers, Scaling, scaled_numbers
from rigidsim.model.state_blocks import BODY
from rigidsim.model.two_part import as_factor
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, dot, norm
from rigidsim.scene.readable import span_text
from rigidsim.scene.scene import Scene

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
_WEAK = 1e-9  # of the largest moment, and of the largest harmonic of an orbit
_SEPARATRIX = (
    "the average isn't valid near the separatrix, the rotation about the intermediate axis, where the wobble "
    "takes forever, and the torques bring the body there"
)
RATE_STATES = BODY.rates
_CLOCK = "t_of_torque"
_MOST_NODES = 1024
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

        At least those that the weight needs (``nodes_needed``); doubled until sums over twice as many agree
        in double precision, which measures the smoothness of the torque itself, and in proportion to the
        digits beyond.

        Raises:
            ArithmeticError: a torque that too many nodes don't resolve.
        """
        if not self.others:
            return 0
        largest = max(map(self.parameter_at, amplitudes))
        count = nodes_needed(largest, max(epsilon, 2.0**-_BITS_CHECKED)) + 8
        # of what is averaged: a mean may vanish
        around = 2 * np.pi * (np.arange(count) + 0.5) / count
        scale = max(float(np.abs(self.change(p, q, around)).max()) for p, q in amplitudes)
        while count <= _MOST_NODES:
            pairs = [(self.mean(p, q, count), self.mean(p, q, 2 * count)) for p, q in amplitudes]
            if all(float(np.abs(x - y).max()) <= _CHECKED * scale for x, y in pairs):
                more = -np.log2(epsilon) / _BITS_CHECKED
                return int(np.ceil(count * max(1.0, more)))
            count *= 2
        raise ArithmeticError

    def wobble(self, axial: float, transverse: float, amplitude: float = 0.0) -> Wobble:
        """The rotation of these amplitudes, internal units."""
        return Wobble(self._moments, axial, transverse, amplitude)

    def parameter_at(self, amplitudes: np.ndarray) -> float:
        """k^2 at amplitudes P and Q."""
        ratio = float(self.polhodes.ratio)
        return 0.0 if ratio == 1 else float((1 - ratio) * (amplitudes[1] / amplitudes[0]) ** 2)

    def across(self, wobble: Wobble) -> np.ndarray:
        """Torque across the momentum, x + i y in the frame that precesses, (points,)."""
        turned = np.einsum("nab,bn->an", wobble.turns, self.at(wobble.momentum))
        return np.asarray(turned[0] + 1j * turned[1])

    def change(self, axial: float, transverse: float, angle: np.ndarray) -> np.ndarray:
        """P' and Q', (2, n), at amplitudes f, per internal unit of time."""
        ratio, root = float(self.polhodes.ratio), float(self.polhodes.root)
        cosine, sine = np.cos(angle), np.sin(angle)
        share = (1 - ratio) * transverse / axial if ratio != 1 else 0.0
        delta = np.sqrt(1 - share * (transverse / axial) * sine**2) if ratio != 1 else np.ones_like(sine)
        momentum = np.array([root * transverse * cosine, transverse * sine, axial * delta])
        torque = self.at(momentum)
        along = torque[2] * delta + share * torque[1] * sine
        return np.array([along, torque[0] * cosine / root + torque[1] * sine])

    def mean(self, axial: float, transverse: float, count: int) -> np.ndarray:
        """Means of P' and Q' over a polhode, (2,), by a sum over nodes."""
        angle = 2 * np.pi * (np.arange(count) + 0.5) / count
        weight = 1 / self.deltas(axial, transverse, angle)
        return np.asarray(self.change(axial, transverse, angle) @ weight / weight.sum())

    def deltas(self, axial: float, transverse: float, angle: np.ndarray) -> np.ndarray:
        """dn at amplitudes f."""
        ratio = float(self.polhodes.ratio)
        if ratio == 1:
            return np.ones_like(angle)
        return np.asarray(np.sqrt(1 - (1 - ratio) * (transverse / axial) ** 2 * np.sin(angle) ** 2))

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
    change = torques.change(start[0], start[1], wobble.amplitudes)
    removed = wobble.removed(change, 0, float(np.abs(change).max())).real
    direction = np.zeros(3)
    if np.isfinite(removed).all():  # what isn't is refused below
        direction = _direction_removed(scene, torques, wobble, momentum)
        axial -= context.ldexp(context.mpf(float(removed[0])), exponent)
        across -= context.ldexp(context.mpf(float(removed[1])), exponent)
        start = [float(context.ldexp(x, -exponent)) for x in (axial, across)]
    if scaling.direction < 0:
        raise refused(level, "torques that change the size of the momentum aren't averaged backwards in time")
    begin, end = (float(context.ldexp(x, -scaling.time)) for x in (scene.start, scene.end))
    times, course, fastest, failure = _followed(torques, np.array(start), begin, end)
    if failure:
        until, what = float(np.ldexp(times[-1], scaling.time)), f'given "{level}", but {failure}'
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
    """Times, amplitudes and the fastest relative rate, by Runge-Kutta steps of the fourth order, and what
    ended them before the run's end.
    """
    time, fastest, part, failure = begin, 0.0, 1.0, ""
    times, amplitudes, initial = [time], [now], float(np.linalg.norm(now))
    if not torques.parameter_at(now) < 1:  # where strong torques leave it, less their periodic part
        return np.array(times), np.array(amplitudes), fastest, _SEPARATRIX

    def rate(state: np.ndarray) -> np.ndarray:
        return torques.mean(float(state[0]), float(state[1]), _NODES)

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
                failure = "a torque has no finite value somewhere on the rotation that it is averaged over"
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
    seconds = np.ldexp(places, scaling.time)
    apart = float(seconds[1] - seconds[0])
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
    sizes, i, j, first = before.strong(_WEAK)
    first, last = np.abs(first), np.abs(i * after.rates[0] + j * after.rates[1])
    low, high = (f(np.array([first, last]) / source.motion, axis=0) for f in (np.min, np.max))
    for n in np.flatnonzero(np.floor(high) >= np.ceil(low)):
        k = np.arange(int(np.ceil(low[n])), min(int(high[n]), len(orbit) - 1) + 1)
        energy = float(source.strength) * sizes[n] * orbit[k[orbit[k] > _WEAK * orbit.max()]]
        order, drift = float(i[n] + abs(j[n])), abs(float(first[n] - last[n])) / seconds
        if (order**2 * energy / before.moments.min() > drift).any():
            return math.inf
        total += float(order * energy.sum() / min(before.size, after.size)) * math.sqrt(2 * math.pi / drift)
    return total
