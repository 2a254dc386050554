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
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.averaged.applies import SWING, refuse_frequencies, refused
from rigidsim.model.averaged.free_motion import FreeMotion, Polhodes, free_motion
from rigidsim.model.averaged.sources import Source
from rigidsim.model.averaged.torques import DrivingTorques
from rigidsim.model.averaged.wobble import ORDERS, Wobble
from rigidsim.model.load import Load
from rigidsim.model.scaling import Scaling, scaled_numbers
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
_NEAR = 1e-3  # of a step, to which the time at which the separatrix is reached is told
_NOTHING = 1e-150  # of the momentum at the start, whose square doubles still hold
_MOST_STEPS = 20_000
_NODES = 256
_PLACES = 48  # along the course, at which resonances are looked for
_WEAK = 1e-9  # of the largest moment, and of the largest harmonic of an orbit
_SEPARATRIX = (
    "the average isn't valid near the separatrix, the rotation about the intermediate axis, where the wobble "
    "takes forever, and the torques bring the body there"
)


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
