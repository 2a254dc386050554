"""An averaged motion under torques of the body alone: its polhode, what averaging removes, and the resonances
with gravity gradients that it passes.

The amplitudes P and Q and the momentum's direction at the start are those of the full motion less their
periodic terms, to first order in the torques (see ``course``).

A combination i g + j l of the body's precession and wobble (see ``spectrum``) that passes a multiple k n of a
source's mean motion turns the momentum by

    (|i| + |j|) (U / L) sqrt(2 pi / abs(d(i g + j l)/dt)),

U being the energy of the harmonic (stationary phase), in a direction that depends on an angle which no
average carries: an error that is announced. If the frequency changes by less than the harmonic's angle
accelerates, the angle may be captured (Neishtadt 1975; Goldreich & Peale 1966), and the average is refused.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.averaged.applies import refuse_frequencies, refused
from rigidsim.model.averaged.course import PARAMETER, SWING, NoCourse, PolhodeCourse, Wave, follow, wave_of
from rigidsim.model.averaged.free_motion import (
    FreeMotion,
    Polhodes,
    free_motion,
    mean_square_sine,
    means_needed,
)
from rigidsim.model.averaged.sources import Source
from rigidsim.model.averaged.spectrum import BodySpectrum, body_spectrum
from rigidsim.model.averaged.torques import DrivingTorques
from rigidsim.model.load import Load
from rigidsim.model.scaling import Scaling, scaled_numbers
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, dot, norm
from rigidsim.scene.readable import span_text
from rigidsim.scene.scene import Scene

EPSILON = 2.0**-60
"""Error that mean torques are worked out to in double precision and below; in higher ones 2^-7 epsilon."""
_PLACES = 48  # along the course, at which resonances with gradients are looked for
_WEAK = 1e-9  # of the largest moment, and of the largest harmonic of an orbit


@dataclass(frozen=True)
class Driven:
    """What torques of the body alone do to an averaged motion; numbers are mpf, SI."""

    titles: Sequence[str]
    polhodes: Polhodes
    torques: DrivingTorques
    course: PolhodeCourse
    axial: Any
    transverse: Any
    amplitude: float  # f at the start, rad
    epsilon: float
    direction: np.ndarray  # periodic part of the momentum's direction at the start
    passed: float = 0.0  # sum of the angles (rad) by which resonances with gradients turn the momentum

    @property
    def scatter(self) -> float:
        """Angle (rad) by which all resonances that are passed may turn the momentum."""
        return self.course.scatter + self.passed

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

    def motion_in_double(self, axial: float, transverse: float) -> FreeMotion:
        """The same from P and Q in internal units, in double precision: cheap enough for many places."""
        scaling, polhodes = self.torques.scaling, self.polhodes
        ratio, root = float(polhodes.ratio), float(polhodes.root)
        if ratio != 1:  # no further than averages go
            transverse = min(transverse, abs(axial) * math.sqrt(PARAMETER / (1 - ratio)))
        wave = wave_of(self.torques, axial, transverse)
        size = math.hypot(axial, root * transverse)
        sines = mean_square_sine(wave.parameter, math.sqrt, means_needed(wave.parameter, 2.0**-60))
        share = (transverse / size) ** 2
        squares = [ratio * share * (1 - sines), share * sines]
        squares.append(1 - sum(squares))
        moments = [float(x) for x in polhodes.moments]
        amplitudes = [abs(x) / size for x in (root * transverse, transverse, axial)]
        wobble = 0.0 if polhodes.symmetric else abs(wave.wobble)
        rates = (math.ldexp(x, -scaling.time) for x in (wave.precession, wobble))
        size = math.ldexp(size, scaling.momentum)
        return FreeMotion(size, moments, polhodes.axes, wave.parameter, squares, amplitudes, *rates)

    def detuned(self, motion: FreeMotion, size: float, shape: float) -> float:
        """Change of ``FreeMotion.excess`` over the momentum (s), to which precession is in proportion, by
        relative errors of the momentum's size and of the energy over its square.
        """
        first, _, third = (float(x) for x in self.polhodes.moments)
        length = float(motion.momentum)
        across = float(motion.amplitudes[0]) ** 2
        twice = length**2 * (across / first + (1 - across) / third)
        scale, found = self.torques.scaling.momentum, []
        for i, j in ((0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)):
            whole, other = (length * (1 + i * size)) ** 2, twice * (1 + i * size) ** 2 * (1 + j * shape)
            turned = min(max((other - whole / third) / (1 / first - 1 / third), 0.0), whole)
            axial, transverse = math.sqrt(whole - turned), math.sqrt(turned / float(self.polhodes.ratio))
            moved = self.motion_in_double(math.ldexp(axial, -scale), math.ldexp(transverse, -scale))
            found.append(float(moved.excess) / moved.momentum)
        return max(abs(x - found[0]) for x in found[1:])


def driven_by(scene: Scene, scaling: Scaling, loads: Sequence[Load], epsilon: float) -> Driven:
    """What these loads, functions of the rates, do to a body that turns as the scene starts.

    Raises:
        Separatrix: the body turns about its intermediate axis.
        ConfigError: their average doesn't apply.
    """
    context, exponent = scene.context, scaling.momentum
    numbers = scaled_numbers(scene, scaling)
    momentum = apply(scene.body.inertia, scene.angular_velocity)
    motion = free_motion(context, scene.body, momentum)
    polhodes = Polhodes.of(context, motion)
    torques = DrivingTorques.of(scene, scaling, numbers, polhodes, loads)
    if varies := torques.varies:
        varies += ", and only torques that are functions of the rates about the body axes are averaged"
        raise refused(scene.config.model.level, varies)
    first, second, third = (dot(axis, momentum) for axis in polhodes.axes)
    across = context.sqrt((first / polhodes.root) ** 2 + second**2)
    axial = third * context.sqrt(1 + (1 - polhodes.ratio) * (second / third) ** 2) if third else third
    amplitude = math.atan2(float(second), float(first / polhodes.root)) if across != 0 else 0.0
    start = [float(context.ldexp(x, -exponent)) for x in (axial, across)]
    wave = wave_of(torques, *start)
    removed = _at(wave.periodic, amplitude)
    fine = np.isfinite(removed).all()
    if fine:  # what isn't is refused below
        axial -= context.ldexp(context.mpf(float(removed[0])), exponent)
        across -= context.ldexp(context.mpf(float(removed[1])), exponent)
        start = [float(context.ldexp(x, -exponent)) for x in (axial, across)]
    begin, end = (float(context.ldexp(x, -scaling.time)) for x in (scene.start, scene.end))
    fineness = min(EPSILON, epsilon / 128)
    try:
        course = follow(torques, start, begin, end, fineness)
    except NoCourse as none:
        level = scene.config.model.level
        what = f'given "{level}", but {none}'
        if none.until is not None and none.until > float(scene.start):
            what += f" after {none.until:.6g} s ({span_text(none.until)}): end the run by then, or"
        else:
            what += ";"
        what += ' choose level = "full"'
        raise ConfigError(Problem("[model] level", what)) from None
    titles = list(dict.fromkeys(load.title for load in loads))
    direction = _direction_removed(scene, polhodes, wave, momentum, amplitude)
    return Driven(titles, polhodes, torques, course, axial, across, amplitude, fineness, direction)


def _at(values: np.ndarray, angle: float) -> np.ndarray:
    """Periodic functions, given by their values along the last dimension, at an angle."""
    count = values.shape[-1]
    if not np.isfinite(values).all():
        return np.full(values.shape[:-1], np.inf)
    order = np.fft.fftfreq(count, 1 / count)
    return np.asarray((np.fft.fft(values) @ np.exp(1j * order * angle)).real / count)


def _direction_removed(
    scene: Scene, polhodes: Polhodes, wave: Wave, momentum: Vector, amplitude: float
) -> np.ndarray:
    """Periodic part of the momentum's direction at the start, space axes."""
    context = scene.context
    combined = wave.precession + wave.orders * wave.wobble
    sizes = np.abs(wave.harmonics)
    # one that stands still is passed or refused in ``course``, and has no periodic part
    moving = np.abs(combined) * SWING > sizes
    parts = np.where(moving, wave.harmonics / np.where(moving, 1j * combined, 1.0), 0.0)
    found = complex(parts @ np.exp(1j * wave.orders * amplitude))
    if found == 0:
        return np.zeros(3)
    body = np.array(attitude.rotation_matrix(scene.quaternion), dtype=float)
    size = norm(context, momentum)
    principal = np.array(polhodes.axes, dtype=float)
    along = np.array([float(x / size) for x in momentum])
    space = frame_along(body @ along)
    m = principal @ along
    own = math.atan2(m[0], m[1])
    if polhodes.symmetric or math.hypot(m[0], m[1]) == 0:
        own = math.atan2(float(polhodes.root) * math.cos(amplitude), math.sin(amplitude))
    nodding = math.atan2(math.hypot(m[0], m[1]), m[2])
    matrix = space @ body @ principal.T @ _about(2, own).T @ _about(0, nodding).T
    precession = math.atan2(matrix[1, 0], matrix[0, 0])
    start = complex(
        _at(np.exp(1j * wave.phase).real, amplitude), _at(np.exp(1j * wave.phase).imag, amplitude)
    )
    found *= complex(math.cos(precession), math.sin(precession)) / start
    return np.asarray(space.T @ np.array([found.real, found.imag, 0.0]))


def _about(axis: int, angle: float) -> np.ndarray:
    """Rotation matrix about an axis."""
    found, i, j = np.eye(3), (axis + 1) % 3, (axis + 2) % 3
    found[i, i] = found[j, j] = math.cos(angle)
    found[j, i] = math.sin(angle)
    found[i, j] = -found[j, i]
    return found


def frame_along(z: np.ndarray) -> np.ndarray:
    """Right-handed orthonormal axes as rows, z last."""
    z = z / np.linalg.norm(z)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x), z])


# --- resonances that are passed -----------------------------------------------------------------------------


def passing(scene: Scene, driven: Driven, sources: Sequence[Source]) -> Driven:
    """The driven motion with the sum of the angles by which passages turn the momentum; raises a ConfigError
    that names the first resonance that can't be passed over, and when it is met.
    """
    if not sources:
        return driven
    times, amplitudes = driven.course.times, driven.course.amplitudes
    seconds = np.ldexp(times, driven.torques.scaling.time)
    places = np.linspace(seconds[0], seconds[-1], _PLACES)
    spectra = []
    for at in places:
        now = [np.interp(at, seconds, amplitudes[:, i]) for i in (0, 1)]
        spectra.append(body_spectrum(driven.motion_in_double(float(now[0]), float(now[1]))))
    apart, total = float(places[1] - places[0]), 0.0
    for n, spectrum in enumerate(spectra):
        when = f", or end the run before {span_text(float(places[n]))}, when torques of the body alone bring "
        when = when + "it there" if n else ""
        beside = spectra[n + 1] if n + 1 < len(spectra) else spectra[n - 1]
        try:
            refuse_frequencies(scene, spectrum, sources, (beside, apart))
        except ConfigError as error:
            (problem,) = error.problems
            raise ConfigError(Problem(problem.where, problem.what + when)) from None
        if n + 1 == len(spectra):
            break
        for source in sources:
            kick, captured = _passed(spectrum, beside, source, apart)
            total += kick
            if captured or total > SWING:
                how = "may be captured in" if captured else f"is turned by {total:.2g} rad by passing"
                against = f"the rotation {how} a resonance with [[loads]] number {source.number}"
                raise refused(scene.config.model.level, against, f'choose level = "full"{when}')
    return replace(driven, passed=total)


def _passed(before: BodySpectrum, after: BodySpectrum, source: Source, seconds: float) -> tuple[float, bool]:
    """Angle (rad) by which resonances passed within so many seconds turn the momentum, and whether one may
    capture it.
    """
    if source.motion == 0:
        return 0.0, False
    orbit = source.harmonics
    sizes = np.maximum(np.abs(before.harmonics), np.abs(after.harmonics))
    sizes[0, 0] = 0.0
    strong = sizes > _WEAK * max(float(x) for x in before.motion.moments)
    i, j = (orders[strong] for orders in before.orders)
    first, last = (np.abs(s.frequencies[strong]) / source.motion for s in (before, after))
    low, high = np.ceil(np.minimum(first, last)), np.floor(np.maximum(first, last))
    least = min(float(x) for x in before.motion.moments if x > 0)
    length = min(float(before.motion.momentum), float(after.motion.momentum))
    turned, captured = 0.0, False
    for n in np.flatnonzero(high >= low):
        k = np.arange(int(low[n]), min(int(high[n]), len(orbit) - 1) + 1)
        k = k[orbit[k] > _WEAK * orbit.max()]
        if not len(k):
            continue
        drift = abs(float(first[n] - last[n])) * source.motion / seconds
        order = abs(float(i[n])) + abs(float(j[n]))
        energy = float(source.strength) * float(sizes[strong][n]) * orbit[k]
        captured = captured or bool((order**2 * energy / least > drift).any())
        turned += float((order * energy / length).sum()) * math.sqrt(2 * math.pi / drift)
    return turned, captured
