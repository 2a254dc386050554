"""Whether an average applies: the kinds of scenes that have one, and the frequencies that forbid it.

Averaging over the rotation fails where a combination i g + j l + k n of the body's precession and wobble (see
``free_motion``) with a source's mean motion is slow enough for its angle to librate or to dwell. With the
harmonic's part U of the potential energy the angle obeys phi'' = -(c U) sin phi with c about (|i| + |j|)^2
over the least moment, so that within 2 sqrt(c U) of zero it librates (Chirikov 1979), and it swings the
momentum by U / (L nu) elsewhere.
"""

import math
from collections.abc import Sequence

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.averaged.resonance import Resonance
from rigidsim.model.averaged.sources import Source
from rigidsim.model.averaged.spectrum import BodySpectrum
from rigidsim.model.averaged.torques import reads_rates_alone
from rigidsim.model.carriers import carried_beside
from rigidsim.model.gradient import GradientSource
from rigidsim.model.load import Load
from rigidsim.scene.choices import ORBIT_AVERAGED
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
"""Largest angle (rad) by which the terms averaged away may swing the momentum or the figure axis: errors are
of second order in it, and beyond it a percent of the precession would be the best to hope for.
"""
_FULL = 'choose level = "full"'
_WEAK = 1e-7  # of the largest harmonic
PASSING = -math.log(_WEAK)
"""Least ratio of the body's frequencies to the angular rate of a source that passes by: its torque has less
than a weak harmonic's part at them.
"""


def refuse_scene(scene: Scene, loads: Sequence[Load]) -> None:
    """Raise a ConfigError for a scene that is of no kind that has averages."""
    config, level, integrator = scene.config, scene.config.model.level, scene.config.integrator
    sources = [source for load in loads if (source := load.gradient_source) is not None]
    alone = [load for load in loads if load.gradient_source is None]
    against, instead = carried_beside(loads), ""
    if scene.free_flight:
        against = "the body has a position and flies"
    elif against:
        pass
    elif unfit := [x.unaveraged for x in loads if x.unaveraged is not None]:
        against, instead = unfit[0]
    elif not loads:
        against = "no torque acts, so that the direction of the angular momentum rests"
    elif max(scene.body.principal_moments) == min(scene.body.principal_moments):
        against = "no gradient has a torque on a body whose moments are all the same"
        if alone:
            against = "a body whose moments are all the same turns steadily, and nothing averages its torques"
    elif alone and level == ORBIT_AVERAGED:
        against = f"{alone[0].title} is no gravity gradient, and is averaged over the rotation alone"
        raise refused(level, against, 'choose "spin_averaged"')
    elif others := [load.title for load in alone if not reads_rates_alone(load)]:
        against = f"{others[0]} is neither the gravity gradient of a source with elements, a place or an "
        against += "ephemeris, nor of one of [[bodies]], nor a function of the rates in body axes"
    elif alone and (found := surfaces_of(scene).found):
        against = f"{found[0].text} ({found[0].where}) has a kink or jump, over which no average is smooth"
    elif all(w == 0 for w in scene.angular_velocity):
        against = "the body starts at rest"
    elif integrator.formulation != "auto":
        against = f'[integrator] formulation = "{integrator.formulation}" carries every rotation'
        instead = "leave it out"
    elif not integrator.has_steps:
        against = f'[integrator] method = "{integrator.method}" is of the full motion'
        instead = "leave it out"
    elif integrator.hold_invariants is True:
        against, instead = "[integrator] hold_invariants = true is for the full motion's", "set it to false"
    elif integrator.accuracy is not None or integrator.accuracy_position is not None:
        against = "[integrator] accuracy is the attitude's, which needs every rotation"
    elif config.events:
        against, instead = "[[events]] read the full state", "remove them"
    elif scene.states:
        against, instead = "[[states]] go with every rotation", "remove them"
    elif config.output.lyapunov:
        against, instead = "[output] lyapunov is of the full motion", "set it to false"
    elif scene.bodies is not None and scene.bodies.full:
        against = 'coupling = "full" makes the bodies feel every rotation of this one'
        raise refused(level, against, 'set [body] coupling to "one_way", or choose level = "full"')
    elif level == ORBIT_AVERAGED and (unsuited := [x for x in map(_unsuited, sources) if x]):
        raise refused(level, *unsuited[0])
    if against:
        raise refused(level, against, f"{instead}, or {_FULL}" if instead else _FULL)
    if alone and config.model.short_period:
        what = f"given true, but what {alone[0].title} does within a rotation isn't added back; "
        raise ConfigError(Problem("[model] short_period", what + "set it to false"))


def _unsuited(source: GradientSource) -> tuple[str, str] | None:
    return source.placement.without_elements


def refuse_frequencies(
    scene: Scene,
    spectrum: BodySpectrum,
    sources: Sequence[Source],
    moving: tuple[BodySpectrum, float] | None = None,
) -> Resonance | None:
    """Refuse a motion whose frequencies aren't far enough apart, with a ConfigError that names the resonance
    that no average can keep, or what is too fast; the one that is kept, if any.

    A rotation that torques change comes with its harmonics at another time, and the seconds between
    (``moving``): resonances that it passes too fast to be captured are no reason to refuse it.
    """
    for source in sources:
        _refuse_passing(scene, spectrum, source)
    found = [_refuse_resonance(scene, spectrum, source, moving) for source in sources]
    kept = [resonance for resonance in found if resonance is not None]
    if len(kept) > 1:
        what = f"the body is in resonance with [[loads]] number {kept[0].source.number} ({kept[0].name}) and "
        what += f"number {kept[1].source.number} ({kept[1].name}) at once"
        raise refused(scene.config.model.level, what)
    for source, resonance in zip(sources, found, strict=True):
        if resonance is None:
            _refuse_forced(scene, spectrum, source)
    if kept and scene.config.model.short_period:
        what = f"given true, but the body is in resonance with [[loads]] number {kept[0].source.number} "
        what += f"({kept[0].name}), and what goes round with that orbit isn't added back; set it to false"
        raise ConfigError(Problem("[model] short_period", what))
    if scene.config.model.level == ORBIT_AVERAGED:
        for source in sources:
            _refuse_slow_orbit(scene, spectrum, source)
    return kept[0] if kept else None


def told_of_resonances(sources: Sequence[Source]) -> str:
    """How resonances with point masses were looked for; empty without point masses."""
    masses = [(source.of.pair.name, source.motion > 0) for source in sources if source.of.pair]
    bound, passing = ([name for name, holds in masses if holds is held] for held in (True, False))
    told = []
    if bound:
        told.append(f"with the osculating orbits of the start for {', '.join(bound)}")
    if passing:
        told.append(f"not for {', '.join(passing)}, not bound to the body and slower than all of its rates")
    return f"; resonances were looked for {', '.join(told)}" if told else ""


def _refuse_resonance(
    scene: Scene, spectrum: BodySpectrum, source: Source, moving: tuple[BodySpectrum, float] | None
) -> Resonance | None:
    """Refuse resonances; return the one that can be kept, if it is the only one."""
    found = np.flatnonzero(spectrum.strong(_WEAK))
    if not len(found):
        return None
    sizes = np.abs(spectrum.harmonics).ravel()[found]
    i, j = (orders.ravel()[found] for orders in spectrum.orders)
    body = spectrum.frequencies.ravel()[found]
    orbit = source.harmonics
    k = np.flatnonzero(orbit > _WEAK * orbit.max())
    least = min(float(x) for x in spectrum.motion.moments if x > 0)
    energy = float(source.strength) * sizes[:, None] * orbit[None, k]
    width = 2 * np.sqrt((np.abs(i) + np.abs(j))[:, None] ** 2 * energy / least)
    rate = np.abs(np.abs(body[:, None]) - k[None, :] * source.motion)
    swing = energy / (float(spectrum.motion.momentum) * np.maximum(rate, 1e-300))
    slow = LIBRATION * width + 2 * source.slow_rate + 2 * source.uncertainty * k[None, :]
    if moving is not None:
        other, seconds = moving
        drift = np.abs(np.abs(other.frequencies.ravel()[found]) - np.abs(body))[:, None] / seconds
        passes = drift > (width / 2) ** 2
        kick = energy / float(spectrum.motion.momentum) * np.sqrt(2 * np.pi / np.maximum(drift, 1e-300))
        slow, swing = np.where(passes, 0.0, slow), np.where(passes, np.minimum(swing, kick), swing)
    kept = _offered(scene, spectrum, source)
    own = held = np.zeros(rate.shape, dtype=bool)
    if kept is not None:
        spin = 2 * float(spectrum.motion.momentum / spectrum.motion.moments[2])
        of_spin = (i == 2) & (np.abs(np.abs(body) - spin) < abs(float(spectrum.motion.wobble_rate)))
        own = of_spin[:, None] & (k == kept.multiple)[None, :]
        # the average keeps the body's axes and the momentum, so that it keeps its wobble as well
        held = (2 * k[None, :] == i[:, None] * kept.multiple) & (rate < source.motion / 2)
    met = bool((own & ((rate < slow) | (swing > SWING))).any())
    keeps = scene.config.model.level == ORBIT_AVERAGED
    remedy = _FULL
    if keeps and met:
        slow, swing = np.where(held, 0.0, slow), np.where(held, 0.0, swing)
    elif met and not keeps:
        remedy = 'choose level = "orbit_averaged", which keeps its angle, or "full"'
    worst = np.unravel_index(int(np.argmax(slow / np.maximum(rate, 1e-300))), rate.shape)
    if rate[worst] < slow[worst] or swing.max() > SWING:
        if not rate[worst] < slow[worst]:
            worst = np.unravel_index(int(np.argmax(swing)), rate.shape)
        at = int(i[worst[0]]), int(j[worst[0]]), int(k[worst[1]])
        period = span_text(2 * np.pi / rate[worst]) if rate[worst] > 0 else "forever"
        raise refused(
            scene.config.model.level,
            f"{_combination(at, float(body[worst[0]]))} of the body's precession g and wobble l "
            f"and of the mean motion n of [[loads]] {source.name} is only "
            f"{float(rate[worst]):.3g} rad/s, once in {period}, where its angle "
            f"librates within {float(width[worst]):.3g} rad/s: a resonance, which no average may pass over",
            remedy,
        )
    return kept if met else None


def _refuse_passing(scene: Scene, spectrum: BodySpectrum, source: Source) -> None:
    """Refuse a point mass that passes by so fast that it sees single rotations.

    The torque of a source that passes at the angular rate w has a continuous spectrum that falls like
    exp(-nu / w), since its singularities in complex time are within 1 / w of the real axis.
    """
    if source.passing_rate is None or source.motion > 0:
        return
    rates = np.append(np.abs(spectrum.frequencies[spectrum.strong(_WEAK)]), abs(spectrum.rates[0]))
    most = PASSING * source.passing_rate
    if rates.min() < most:
        raise refused(
            scene.config.model.level,
            f"the point mass of [[loads]] {source.name} isn't bound to the body and passes it, by their "
            f"motion at the start, at {source.passing_rate:.3g} rad/s, which the body's slowest "
            f"frequency, {rates.min():.3g} rad/s, has to exceed by a factor of {PASSING:.0f}",
        )


def _offered(scene: Scene, spectrum: BodySpectrum, source: Source) -> Resonance | None:
    """Nearest spin-orbit resonance with a source on a Kepler orbit, for rotation about axis 3; or None."""
    motion = spectrum.motion
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
    told = [f"{'+' if c > 0 else '-'} {abs(c) if abs(c) != 1 else ''}{name}" for c, name in terms if c]
    return " ".join(told).removeprefix("+ ")


def _refuse_forced(scene: Scene, spectrum: BodySpectrum, source: Source) -> None:
    """Refuse a torque too fast, beside the free motion, for the figure axis to follow the momentum."""
    motion, orbit = spectrum.motion, source.harmonics
    k = np.arange(len(orbit))
    g = spectrum.rates[0]
    torque = float(source.strength) * max(float(max(motion.moments) - min(motion.moments)), 0.0)
    forced = torque * orbit / (float(motion.momentum) * np.maximum(np.abs(g - k * source.motion), 1e-300))
    forced[orbit < _WEAK * orbit.max()] = 0.0
    most = int(np.argmax(forced))
    if forced[most] > SWING:
        raise refused(
            scene.config.model.level,
            f"the torque of [[loads]] {source.name} bends the rotation by {forced[most]:.2g} rad, "
            f"since the body precesses freely at {g:.3g} rad/s and the source goes round at "
            f"{source.motion:.3g} rad/s; up to {SWING} rad is allowed",
        )


def _refuse_slow_orbit(scene: Scene, spectrum: BodySpectrum, source: Source) -> None:
    if source.motion == 0:
        return
    context, motion = scene.context, spectrum.motion
    rate = float(abs(source.secular_strength(context) * motion.excess / motion.momentum))
    if rate > SWING * source.motion or source.slow_rate > SWING * source.motion:
        what = "the momentum precesses" if rate >= source.slow_rate else "node and periapsis move"
        raise refused(
            scene.config.model.level,
            f"{what} by {max(rate, source.slow_rate) / source.motion:.2g} rad for each radian that the "
            f"source of [[loads]] number {source.number} goes round; up to {SWING} is allowed",
            'choose "spin_averaged"',
        )


def refused(level: str, against: str, remedy: str = _FULL) -> ConfigError:
    """The error for an average that doesn't apply."""
    return ConfigError(Problem("[model] level", f'given "{level}", but {against}; {remedy}'))
