"""The course of an averaged motion under torques of the body alone, followed ahead in double precision.

The mean torques change P and Q (see ``free_motion``) whatever the momentum's direction; their course is
known before the run: over which polhodes torques have to be averaged, and whether each average applies.
It doesn't near the separatrix, where the wobble takes as long as the change of its size; nor where torques
change the motion much within one rotation. Where an even harmonic of the wobble keeps pace with the
precession, g + j l = 0, the torque across the momentum stands still for a while and turns its direction by

    sqrt(2 pi / abs(d(g + j l)/dt)) abs(N_j) / L

(stationary phase; Neishtadt 1975), in a direction that an average can't know: an error that is announced.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigidsim.model.averaged.torques import DrivingTorques

PARAMETER = 0.98
"""Largest k^2 over whose polhodes torques are averaged."""
APPROACH = 0.25
"""Largest part of the way to the separatrix, 1 - k^2, that k^2 may change within a wobble."""
SWING = 0.05
"""Largest change within a rotation, of the momentum's direction (rad) and of P and Q over the momentum."""
_STEP = 0.05  # of the time in which P or Q change by their own size
_STABLE = 1.0  # of the inverse rate of what has decayed
_NEGLIGIBLE = 1e-7  # of the momentum: a wobble that no longer sets the step
_NEAR = 1e-3  # of a step, to which the time at which the separatrix is reached is told
_NOTHING = 1e-150  # of the momentum at the start, whose square doubles still hold
_MOST_STEPS = 20_000
_EXAMINED = 400  # places along the course
_GRID = 512  # amplitudes over a turn; harmonics of dn fall like e^(-0.14 j) up to ``PARAMETER``
_WEAK = 1e-12  # of the largest harmonic
_NODES = 256


class NoCourse(Exception):
    """Raised if the mean torques can't be followed, or up to some time of the scene (s) alone; says why."""

    def __init__(self, why: str, until: float | None = None) -> None:
        super().__init__(why)
        self.until = until


_SEPARATRIX = (
    "the average isn't valid near the separatrix, the rotation about the intermediate axis, where the wobble "
    "takes forever, and the torques bring the body there"
)
_UNDEFINED = "a torque has no finite value somewhere on the rotation that it is averaged over"


@dataclass(frozen=True)
class Wave:
    """What a torque does within a rotation, at one place of the course; internal units.

    The harmonics are Fourier coefficients over the amplitude of the torque across the momentum, turned back
    by the mean precession, over L times the rate of the amplitude: rad.
    """

    periodic: np.ndarray  # P and Q less their mean course, over ``_GRID`` amplitudes, (2, n)
    parameter: float  # k^2
    wobble: float  # l (signed), rad per unit of time; precession is g
    precession: float
    harmonics: np.ndarray
    orders: np.ndarray
    phase: np.ndarray  # of the precession less its mean course, at the amplitudes


def wave_of(torques: DrivingTorques, axial: float, transverse: float) -> Wave:
    """What the torques do within a rotation of amplitudes P and Q."""
    first, second, third = (float(x) for x in torques.polhodes.moments)
    unit = 2.0**-torques.scaling.inertia
    first, second, third = first * unit, second * unit, third * unit
    ratio, root = float(torques.polhodes.ratio), float(torques.polhodes.root)
    angle = 2 * np.pi * np.arange(_GRID) / _GRID
    cosine, sine = np.cos(angle), np.sin(angle)
    delta = torques.deltas(axial, transverse, angle)
    pace = axial * (third - second) / (root * second * third)
    change = torques.change(axial, transverse, angle)
    weight = 1 / delta
    mean = change @ weight / weight.sum()
    order = np.fft.fftfreq(_GRID, 1 / _GRID)
    divisor = np.where(order == 0, 1.0, 1j * order)

    def integral(rate: np.ndarray) -> np.ndarray:
        """Periodic part of the integral over the angle."""
        spectrum = np.fft.fft(rate) / divisor
        spectrum[..., 0] = 0.0
        return np.asarray(np.fft.ifft(spectrum).real)

    moved = (change - mean[:, None]) * weight
    scale = float(np.abs(change).max())
    periodic = np.zeros_like(change)
    if pace != 0 and np.abs(moved).max() > 1e-13 * scale:
        periodic = integral(moved) / pace
        periodic -= ((periodic * weight).mean(axis=1) / weight.mean())[:, None]
    elif pace == 0 and np.abs(moved).max() > 1e-13 * scale:
        periodic = np.full_like(change, np.inf)
    momentum = np.array([root * transverse * cosine, transverse * sine, axial * delta])
    length = float(np.linalg.norm(momentum[:, 0]))
    squares = ratio * cosine**2, sine**2
    rate = length * (squares[0] / first + squares[1] / second) / (squares[0] + squares[1])
    turning = float((rate * weight).mean() / weight.mean())
    # less what grows with the amplitude itself, whose harmonics these are
    phase = integral(rate * weight) / pace if pace != 0 else np.zeros(_GRID)
    torque = torques.at(momentum)
    nodding = np.arctan2(np.hypot(momentum[0], momentum[1]), momentum[2])
    sign = 1.0 if transverse >= 0 else -1.0
    own = np.arctan2(sign * root * cosine, sign * sine)
    across = np.cos(own) * torque[0] - np.sin(own) * torque[1]
    upwards = np.sin(own) * torque[0] + np.cos(own) * torque[1]
    seen = across + 1j * (np.cos(nodding) * upwards - np.sin(nodding) * torque[2])
    harmonics = np.fft.fft(np.exp(1j * phase) * seen * weight) / _GRID / length
    parameter = _parameter(torques, (axial, transverse))
    mean_weight = float(weight.mean())
    # over time: the rate of the mean angle is pace / <1 / dn>, by which the harmonics are to be divided
    return Wave(periodic, parameter, pace / mean_weight, turning, harmonics / mean_weight, order, phase)


@dataclass(frozen=True)
class PolhodeCourse:
    """P and Q along the run; internal units."""

    torques: DrivingTorques
    times: np.ndarray
    amplitudes: np.ndarray
    nodes: int
    parameter: float  # largest k^2
    fastest: float  # largest rate at which torques change P, Q or the momentum, relative to their sizes
    scatter: float  # sum of the angles (rad) by which passing resonances turn the momentum
    swing: float  # largest angle (rad) by which the torques swing the momentum within a rotation
    swings: tuple[float, float]  # largest relative changes of momentum and energy within a wobble

    @cached_property
    def least(self) -> float:
        """Smallest size of the momentum over the one at the start."""
        root = float(self.torques.polhodes.root)
        sizes = np.hypot(self.amplitudes[:, 0], root * self.amplitudes[:, 1])
        return float(sizes.min() / sizes[0])

    @cached_property
    def tilt(self) -> float:
        """Largest angle (rad) between the momentum and the circled axis."""
        axial, transverse = self.amplitudes.T
        root = float(self.torques.polhodes.root)
        sines = np.abs(transverse) / np.hypot(axial, root * transverse)
        return float(np.arcsin(np.minimum(sines, 1.0)).max())


def follow(
    torques: DrivingTorques, start: Sequence[float], begin: float, end: float, epsilon: float
) -> PolhodeCourse:
    """Follow the mean torques over the run; NoCourse says from when on no average applies, and why."""
    first = np.array(start, dtype=float)
    if not _parameter(torques, first) < 1:  # where strong torques leave it, less their periodic part
        raise NoCourse(_SEPARATRIX)
    times, amplitudes, fastest, failure = _followed(torques, first, begin, end)
    picked = np.unique(np.linspace(0, len(times) - 1, _EXAMINED).astype(int))
    waves = [wave_of(torques, *amplitudes[i]) for i in picked]
    root = float(torques.polhodes.root)
    for n, (i, wave) in enumerate(zip(picked, waves, strict=True)):
        against = _examine(torques, amplitudes[i], wave, root)
        if against is not None:
            raise NoCourse(against, _seconds(torques, times[picked[n - 1]]) if n else None)
    if failure is not None:
        raise NoCourse(failure, _seconds(torques, times[-1]))
    scatter, swing = _turned(times[picked], waves)
    if swing > SWING or scatter > SWING:
        raise NoCourse(
            f"the torques across the momentum turn it by {max(swing, scatter):.2g} rad within a rotation, of "
            f"which up to {SWING} rad is allowed"
        )
    try:
        nodes = torques.nodes(amplitudes[picked[:: max(1, len(picked) // 8)]], epsilon)
    except ArithmeticError:
        raise NoCourse("a torque changes too abruptly with the rates to be averaged over them") from None
    found = [_changed(torques, amplitudes[i], wave) for i, wave in zip(picked, waves, strict=True)]
    swings = max(x for x, _ in found), max(y for _, y in found)
    largest = max(w.parameter for w in waves)
    return PolhodeCourse(torques, times, amplitudes, nodes, largest, fastest, scatter, swing, swings)


def _changed(torques: DrivingTorques, amplitudes: np.ndarray, wave: Wave) -> tuple[float, float]:
    """Largest relative changes of the momentum's size and of the energy within a wobble."""
    first, _, third = (float(x) for x in torques.polhodes.moments)
    ratio = float(torques.polhodes.ratio)
    found = []
    for weights in ((1.0, ratio), (first, ratio * third)):  # of P^2 and Q^2; L changes by half as much as L^2
        whole = sum(w * x * x for w, x in zip(weights, amplitudes, strict=True))
        change = sum(2 * w * x * y for w, x, y in zip(weights, amplitudes, wave.periodic, strict=True))
        found.append(float(np.abs(change).max()) / whole)
    return found[0] / 2, found[1]


def _followed(
    torques: DrivingTorques, now: np.ndarray, begin: float, end: float
) -> tuple[np.ndarray, np.ndarray, float, str | None]:
    """Times, amplitudes and the fastest relative rate, by Runge-Kutta steps of the fourth order, and what
    ended them before the run's end.
    """
    time, fastest, part = begin, 0.0, 1.0
    times, amplitudes = [time], [now]
    failure: str | None = None

    def rate(state: np.ndarray) -> np.ndarray:
        return torques.mean(float(state[0]), float(state[1]), _NODES)

    while time < end:
        first = rate(now)
        size = float(np.linalg.norm(now))
        if size < _NOTHING * float(np.linalg.norm(amplitudes[0])):
            failure = "the torques bring the body to rest"
            break
        relative = np.abs(first) / np.maximum(np.abs(now), _NEGLIGIBLE * size)
        speed = np.where(np.abs(now) > _NEGLIGIBLE * size, relative / _STEP, relative / _STABLE)
        fastest = max(fastest, float(np.linalg.norm(first)) / size, float(relative.max()))
        step = part * min(end - time, 1 / float(speed.max()) if speed.max() > 0 else end - time)
        with np.errstate(invalid="ignore"):  # beyond the separatrix, which is looked at below
            second = rate(now + step / 2 * first)
            third = rate(now + step / 2 * second)
            fourth = rate(now + step * third)
        later = now + step / 6 * (first + 2 * second + 2 * third + fourth)
        if not np.isfinite(later).all() or _parameter(torques, later) > PARAMETER:
            part /= 2
            if part < _NEAR:
                beyond = _parameter(torques, now + step * first) > PARAMETER
                failure = _SEPARATRIX if beyond else _UNDEFINED
                break
            continue
        time = end if step >= end - time else time + step
        now = later
        times.append(time)
        amplitudes.append(now)
        if len(times) > _MOST_STEPS:
            failure = "the torques change the motion too often to be followed ahead of the run"
            break
    return np.array(times), np.array(amplitudes), fastest, failure


def _parameter(torques: DrivingTorques, amplitudes: Sequence[float] | np.ndarray) -> float:
    """k^2 at amplitudes P and Q."""
    ratio = float(torques.polhodes.ratio)
    return 0.0 if ratio == 1 else float((1 - ratio) * (amplitudes[1] / amplitudes[0]) ** 2)


def _seconds(torques: DrivingTorques, time: float) -> float:
    return float(np.ldexp(time, torques.scaling.time))


def _examine(torques: DrivingTorques, amplitudes: np.ndarray, wave: Wave, root: float) -> str | None:
    """What is against an average at a place: torques that change the polhode much within a rotation."""
    if not np.isfinite(wave.harmonics).all():
        return _UNDEFINED
    size = float(np.hypot(amplitudes[0], root * amplitudes[1]))
    changed = float(np.abs(wave.periodic).max()) / size
    if not changed <= SWING:
        return (
            f"the torques change the rotation by {changed:.2g} of its size within a wobble, of which up to "
            f"{SWING} is allowed"
        )
    if wave.parameter == 0 or wave.wobble == 0:
        return None
    axial, transverse = amplitudes
    moved = np.abs(wave.periodic).max(axis=1)
    mean = np.abs(torques.mean(axial, transverse, _NODES)) * 2 * np.pi / abs(wave.wobble)
    relative = (moved + mean) / np.abs([axial, transverse])
    if 2 * wave.parameter * float(relative.sum()) > APPROACH * (1 - wave.parameter):
        return _SEPARATRIX
    return None


def _turned(times: np.ndarray, waves: Sequence[Wave]) -> tuple[float, float]:
    """Angles by which resonances (their sum) and rotations (the largest) turn the momentum."""
    scatter = swing = 0.0
    for n, wave in enumerate(waves):
        sizes = np.abs(wave.harmonics)
        if not sizes.any():
            continue
        strong = sizes > _WEAK * sizes.max()
        combined = np.abs(wave.precession + wave.orders * wave.wobble)[strong]
        later = waves[n + 1] if n + 1 < len(waves) else None
        drift = 0.0
        if later is not None and wave.wobble != 0 and later.wobble != 0:
            before, after = wave.precession / wave.wobble, later.precession / later.wobble
            drift = abs((after - before) * wave.wobble / (times[n + 1] - times[n]))
            passed = strong & ((before + wave.orders) * (after + wave.orders) < 0)
            if passed.any():
                scatter += float(sizes[passed].sum()) * np.sqrt(2 * np.pi / drift)
        floor = max(np.sqrt(drift / (2 * np.pi)), 1e-300)
        swing = max(swing, float((sizes[strong] / np.maximum(combined, floor)).sum()))
    return scatter, swing
