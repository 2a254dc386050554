"""Error of an averaged model, measured over windows in which every rotation is resolved beside it.

At the beginning, the middle and the end of the span the full motion starts from the averaged one's state,
with what averaging removed added back, and both are followed. Their difference is a growth, which the
averaged motion carries over the span (``rigidsim.accuracy.models.carrying``), plus an oscillation, whatever
the span. A run that is hardly longer than the windows is followed to its end instead. The errors of the
integration itself are another matter (``rigidsim.accuracy.estimates.estimate``).
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
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
class ModellingError:
    """Error of a reduced model.

    Attributes:
        momentum, figure: errors of the recorded directions until the end of the run, rad; at most pi.
        growth: mean growth of the momentum's direction error until the end, rad/s.
        oscillation: part that doesn't grow, rad: what isn't added back to the momentum's direction.
        whole: whether the full model was followed to the end.
        how: description of the measurement.
        cpu_seconds: CPU time of the measurement, s.
        changes: relative errors until the end of quantities that change: ``SIZE`` and ``ENERGY``.
    """

    level: str
    momentum: float
    figure: float | None
    growth: float
    oscillation: float
    whole: bool
    how: str
    cpu_seconds: float
    windows: Sequence[Window] = field(default_factory=list)
    changes: Mapping[str, float] = field(default_factory=dict)

    @property
    def cpu_seconds_of_run(self) -> float:
        """CPU time, s, that the measurement takes after a run, from one over its beginning alone."""
        return self.cpu_seconds if self.whole else self.cpu_seconds * _WINDOWS / len(self.windows)

    @property
    def worst(self) -> float:
        """The larger error of both directions, rad."""
        return max(self.momentum, self.figure or 0.0)


def measure_modelling(
    prepared: InitialValueProblem, trail: SampleTrail | None = None, go_on: Callable[[], bool] = lambda: True
) -> ModellingError:
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
    if whole:
        (window,) = windows
        return ModellingError(
            average.level,
            min(_SPARE_OF_WHOLE * window.recorded, math.pi),
            None
            if window.recorded_figure is None
            else min(_SPARE_OF_WHOLE * window.recorded_figure, math.pi),
            math.hypot(*window.growth),
            window.recorded,
            True,
            "every rotation was resolved beside the run to its end",
            time.process_time() - started,
            windows,
            {name: _SPARE_OF_WHOLE * change.largest for name, change in window.changes.items()},
        )
    motions = [motion_at(average, states, exponent) for _, states, _ in places]
    steady = average.resonance is not None or not average.sources
    carried = None if steady else carrying(prepared, average, go_on)
    return _extrapolated(prepared, average, windows, motions, end - begin, started, carried)


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
    started: float,
    carried: Carrying | None,
) -> ModellingError:
    """Error at the end from that in windows."""
    rates = np.array([w.growth for w in windows])
    doubt = max(w.doubt for w in windows)
    mean = np.abs(rates.mean(axis=0)) + (rates.max(axis=0) - rates.min(axis=0)) / 2
    along, across = (float(x) + doubt for x in mean)
    changes, faster = _changed(average, windows, span), 0.0
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
    if average.driven is not None:  # which may be larger between the windows
        oscillation = max(oscillation, average.driven.course.swing) + average.driven.scatter
    growth = grown / span
    momentum = _SPARE * grown + _SPARE_OF_WHOLE * oscillation
    figure = None
    if average.figure:
        figure = _SPARE * grown + _SPARE_OF_WHOLE * max(w.recorded_figure or 0.0 for w in windows)
        figure = min(figure, math.pi)
    share = sum(w.end - w.start for w in windows) / span
    steps = sum(w.steps for w in windows)
    how = f"every rotation was resolved beside the run in {len(windows)} windows ({100 * share:.2g} % of it, "
    how += f"{steps:,} steps), and the growth found there carried to its end"
    return ModellingError(
        average.level,
        min(momentum, math.pi),
        figure,
        growth,
        oscillation,
        False,
        how,
        time.process_time() - started,
        windows,
        changes,
    )


def _changed(average: Average, windows: Sequence[Window], span: float) -> dict[str, float]:
    """Relative errors until the end of quantities that change."""
    found: dict[str, float] = {}
    if average.driven is None:
        return found
    swings = dict(zip((SIZE, ENERGY), average.driven.course.swings, strict=True))
    for name in (SIZE, ENERGY):
        largest = max(swings[name], *(window.changes[name].largest for window in windows))
        grown = _grown(windows, name, span)
        found[name] = _SPARE * grown + _SPARE_OF_WHOLE * (largest + average.driven.passed)
    return found


def _grown(windows: Sequence[Window], name: str, seconds: float) -> float:
    """By how much the relative error of a changing quantity grows."""
    seen = [window.changes[name] for window in windows]
    rates = np.array([change.growth for change in seen])
    rate = abs(rates.mean()) + (rates.max() - rates.min()) / 2 + max(change.doubt for change in seen)
    return float(rate) * seconds
