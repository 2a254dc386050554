"""Whether an average applies: the kinds of scenes that have one, and the frequencies that forbid it.

Averaging over the rotation fails where a combination i g + j l + k n of the body's precession and wobble (see
``free_motion``) with a source's mean motion is slow enough for its angle to librate or to dwell. With the
harmonic's part U of the potential energy the angle obeys phi'' = -(c U) sin phi with c about (|i| + |j|)^2
over the least moment, so that within 2 sqrt(c U) of zero it librates (Chirikov 1979), and it swings the
momentum by U / (L nu) elsewhere. Resonances may be too slow for the windows of a run over which its error is
measured (``rigidsim.accuracy.modelling``); whatever else makes an average bad is seen there.
"""

import math
from collections.abc import Sequence

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.averaged.free_motion import FreeMotion
from rigidsim.model.averaged.resonance import Resonance
from rigidsim.model.averaged.sources import Source
from rigidsim.model.averaged.wobble import Wobble
from rigidsim.model.carriers import Carrier, carried_beside
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
    unsuited = [x for source in sources if (x := source.placement.without_elements)] if over_orbits else []
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
        *((True, *why) for why in unsuited),
    ]  # fmt: skip
    for holds, against, remedy in said:
        if holds:
            raise refused(level, against, remedy or _FULL)
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
    if len(kept) > 1:
        raise refused(
            scene.config.model.level, f"the body is in resonance with [[loads]] {' and '.join(names)} at once"
        )
    if kept and scene.config.model.short_period:
        refuse_short_period(f"in resonance with [[loads]] {names[0]} what goes round with that orbit")
    return kept[0] if kept else None


def resonance_search(sources: Sequence[Source]) -> str:
    """How resonances with point masses were looked for; empty without point masses."""
    masses = [(source.of.placement.name, source.motion > 0) for source in sources if source.of.reacts]
    bound, passing = ([name for name, holds in masses if holds is held] for held in (True, False))
    searches = []
    if bound:
        searches.append(f"with the osculating orbits of the start for {', '.join(bound)}")
    if passing:
        searches.append(
            f"not for {', '.join(passing)}, not bound to the body and slower than all of its rates"
        )
    return f"; resonances were looked for {', '.join(searches)}" if searches else ""


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
