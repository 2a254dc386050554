"""Resonances with gravity gradients that a rotation passes through as torques change it.

A combination i g + j l of the body's precession and wobble (see ``spectrum``) that passes a multiple k n of a
source's mean motion turns the momentum by

    (|i| + |j|) (U / L) sqrt(2 pi / abs(d(i g + j l)/dt)),

U being the energy of the harmonic (stationary phase), in a direction that depends on an angle which no
average carries: an error that is announced. If the frequency changes by less than the harmonic's angle
accelerates, the angle may be captured (Neishtadt 1975; Goldreich & Peale 1966), and the average is refused.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.averaged.applies import refuse_frequencies, refused
from rigidsim.model.averaged.course import SWING
from rigidsim.model.averaged.driven import Driven
from rigidsim.model.averaged.sources import Source
from rigidsim.model.averaged.spectrum import BodySpectrum, body_spectrum
from rigidsim.scene.readable import span_text
from rigidsim.scene.scene import Scene

_PLACES = 48  # along the course
_WEAK = 1e-9  # of the largest moment, and of the largest harmonic of an orbit


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
        when = _when(scene, float(places[n]))
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


def _when(scene: Scene, seconds: float) -> str:
    if seconds == float(scene.start):
        return ""
    return f", or end the run before {span_text(seconds)}, when torques of the body alone bring it there"


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
