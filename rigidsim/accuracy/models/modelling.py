"""Error of an averaged model, measured over windows in which every rotation is resolved beside it.

At the beginning, the middle and the end of the span the full motion starts from the averaged one's state,
with what averaging removed added back, and both are followed. Their difference is a growth, which the
averaged motion carries over the span (``rigidsim.accuracy.models.carrying``), plus an oscillation, whatever
the span. A run that is hardly longer than the windows is followed to its end instead. The errors of the
integration itself are another matter (``rigidsim.accuracy.estimates.estimate``).
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.accuracy.models.carrying import Carrying, carrying
from rigidsim.accuracy.models.side_by_side import (
    ENERGY,
    SHAPE,
    SIZE,
    Window,
    motion_at,
    rotation_rates,
    side_by_side,
)
from rigidsim.model.averaged.average import Average
from rigidsim.model.averaged.free_motion import FreeMotion
from rigidsim.solve.effects.waypoints import SampleTrail
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.store.summary_parts import Modelling

_ORBITS = 8  # of the slowest source, from which a growth is told from what goes round with it
_FEWEST_ORBITS = 2
_ROTATIONS = 4000  # rotations per window, some 20,000 steps
_MOST_ROTATIONS = 20_000  # for the fewest orbits
_LEAST_ROTATIONS = 50
_LIBRATIONS = 2
_WHOLE = 4  # windows that a run is followed to its end in place of
_WINDOWS = 3  # of a run that is longer
_SPARE = 2.0
"""Factor on the growth until the end, which is measured in three windows and varies between them."""
_SPARE_OF_WHOLE = 1.25  # for the times between the samples
_TURN = 2 * math.pi


@dataclass(frozen=True)
class Measured:
    """The error of an averaged model, as summaries keep it, and what was seen over the beginning: the CPU
    time, s, that measuring takes after a run, and the averaged model's steps over those of the full one.
    """

    modelling: Modelling
    seconds_of_run: float
    share: float

    @property
    def worst(self) -> float:
        """The larger error of both directions, rad."""
        return self.modelling.worst or 0.0


def modelling_of(prepared: InitialValueProblem, **found: Any) -> Modelling:
    """What a summary says of the model of a run whose rotation is averaged, with what was ``found`` of it."""
    average, asked = prepared.system.formulation.average, prepared.scene.config.integrator.accuracy_axis
    assert average is not None
    return Modelling(
        level=average.level,
        short_period=average.short_period,
        resonance="" if average.resonance is None else average.resonance.name,
        requested=None if asked is None else float(asked),
        **found,
    )


def measure_modelling(
    prepared: InitialValueProblem, trail: SampleTrail | None = None, go_on: Callable[[], bool] = lambda: True
) -> Measured:
    """Measure the modelling error of a run, from some of its samples; without them over its beginning alone.
    Raises ``Unmeasured`` if ``go_on`` ended it, or one of the models can't be followed.
    """
    average = prepared.system.formulation.average
    assert average is not None
    started = time.process_time()
    scene = prepared.scene
    begin, end = float(scene.start), float(scene.samples.last)
    exponent = prepared.system.scaling.momentum
    at_start = average.initial(exponent)
    length = min(_length(average, motion_at(average, at_start, exponent)), end - begin)
    whole = end - begin <= _WHOLE * length
    places = [(begin, at_start, length)]
    if not whole:
        places += _places(prepared, average, trail, begin, end, length)
    windows: list[Window] = []
    for at, direction, length in places:
        until = end if whole else at + length
        windows.append(side_by_side(prepared, average, at, until, direction, go_on))
    span, grown = end - begin, 0.0
    if whole:
        (window,) = windows
        oscillation, figure = window.recorded, window.recorded_figure
        changes = {name: _SPARE_OF_WHOLE * change.largest for name, change in window.changes.items()}
        growth = math.hypot(window.kept.growth_along, window.kept.growth_across)
        how = "every rotation was resolved in a second run to its end"
    else:
        motions = [motion_at(average, states, exponent) for _, states, _ in places]
        steady = average.resonance is not None or not average.sources
        carried = None if steady else carrying(prepared, average, go_on)
        grown, oscillation = _extrapolated(prepared, average, windows, motions, span, carried)
        figure = max(w.recorded_figure or 0.0 for w in windows) if average.figure else None
        changes, growth = _changed(average, windows, span), grown / span
        share = sum(w.kept.end - w.kept.start for w in windows) / span
        steps = sum(w.kept.steps for w in windows)
        how = f"every rotation was resolved in {len(windows)} windows ({100 * share:.2g} % of "
        how += f"the run, {steps:,} steps), and the growth found there carried to its end"
    seconds = time.process_time() - started
    found = modelling_of(
        prepared,
        momentum_axis=min(_SPARE * grown + _SPARE_OF_WHOLE * oscillation, math.pi),
        figure_axis=None if figure is None else min(_SPARE * grown + _SPARE_OF_WHOLE * figure, math.pi),
        angular_momentum_norm=changes.get(SIZE),
        energy=changes.get(ENERGY),
        growth=growth,
        oscillation=oscillation,
        whole=whole,
        how=how,
        cpu_seconds=seconds,
        windows=tuple(w.kept for w in windows),
    )
    of_run = seconds if whole else seconds * _WINDOWS / len(windows)
    return Measured(found, of_run, windows[0].reduced_steps / max(windows[0].kept.steps, 1))


def _length(average: Average, motion: FreeMotion) -> float:
    """Length of a window, s, for a free motion."""
    rates = rotation_rates(motion)
    rotation = _TURN / max(rates)
    if average.resonance is not None:
        libration = _TURN / average.resonance.libration_rate
        return max(_ORBITS * _TURN / average.resonance.source.motion, _LIBRATIONS * libration)
    slowest = max((_TURN / s.motion for s in average.sources if s.motion > 0), default=0.0)
    orbits = min(_ORBITS * slowest, _ROTATIONS * rotation)
    least = min(_FEWEST_ORBITS * slowest, _MOST_ROTATIONS * rotation)
    return max(orbits, least, _LEAST_ROTATIONS * _TURN / min(r for r in rates if r > 0))


def _places(
    prepared: InitialValueProblem,
    average: Average,
    trail: SampleTrail | None,
    begin: float,
    end: float,
    length: float,
) -> list[tuple[float, list[Any], float]]:
    """Middle and end: the nearest samples, with the states there, the momentum's direction first, and the
    lengths of the windows.
    """
    context, exponent = prepared.scene.context, prepared.system.scaling.time
    kept = [] if trail is None else trail.samples
    seen = [
        (math.ldexp(float(time), exponent), [context.mpf(float(x)) for x in state])
        for _, time, state, _ in kept
    ]
    seen = [(at, state) for at, state in seen if at > begin + length]
    found: list[tuple[float, list[Any], float]] = []
    for middle in (True, False):
        if not seen:
            break
        last = length
        if average.driven is not None and not middle:  # a rotation that has become slower takes longer
            last = _length(average, motion_at(average, seen[-1][1], prepared.system.scaling.momentum))
            last = min(max(last, length), (end - begin) / 2)
        wanted = (begin + end) / 2 if middle else end - last
        near = seen
        if average.driven is not None:  # whose course is known until the end alone
            near = [place for place in seen if place[0] <= wanted] or seen[:1]
        at, state = min(near, key=lambda place: abs(place[0] - wanted))
        if average.driven is not None:
            last = min(last, end - at)
        if last > 0 and all(at != other for other, _, _ in found):
            found.append((at, state, last))
    return found


def _extrapolated(
    prepared: InitialValueProblem,
    average: Average,
    windows: list[Window],
    motions: Sequence[FreeMotion],
    span: float,
    carried: Carrying | None,
) -> tuple[float, float]:
    """How far the momentum's direction is off at the end, from its growth in windows, and its oscillation."""
    rates = np.array([(w.kept.growth_along, w.kept.growth_across) for w in windows])
    doubt = max(w.kept.doubt for w in windows)
    mean = np.abs(rates.mean(axis=0)) + (rates.max(axis=0) - rates.min(axis=0)) / 2
    along, across = (float(x) + doubt for x in mean)
    faster = 0.0
    if average.driven is not None and average.sources:
        # lasting errors of size and energy change the rate of precession; what oscillates doesn't
        kept = [
            max(abs(window.changes[name].mean) for window in windows)
            + _grown(windows, name, span / 2)
            + average.driven.passed
            for name in (SIZE, SHAPE)
        ]
        detuned = max(average.driven.detuned(motion, kept[0], kept[1]) for motion in motions)
        faster = average.strength * detuned
    if carried is None:
        # an error across the precession changes the rate along it
        shear = float(average.shear(prepared.scene.context, prepared.scene.start))
        grown = math.hypot(along + faster + shear * across * span / 2, across) * span
    else:
        grown = carried.grown(along + faster, across)
    oscillation = max(w.recorded for w in windows)
    if average.driven is not None:  # resonances between the windows
        oscillation += average.driven.passed
    return grown, oscillation


def _changed(average: Average, windows: Sequence[Window], span: float) -> dict[str, float]:
    """Relative errors until the end of quantities that change."""
    found: dict[str, float] = {}
    if average.driven is None:
        return found
    for name in (SIZE, ENERGY):
        largest = max(window.changes[name].largest for window in windows)
        grown = _grown(windows, name, span)
        found[name] = _SPARE * grown + _SPARE_OF_WHOLE * (largest + average.driven.passed)
    return found


def _grown(windows: Sequence[Window], name: str, seconds: float) -> float:
    """By how much the relative error of a changing quantity grows."""
    seen = [window.changes[name] for window in windows]
    rates = np.array([change.growth for change in seen])
    rate = abs(rates.mean()) + (rates.max() - rates.min()) / 2 + max(change.doubt for change in seen)
    return float(rate) * seconds
