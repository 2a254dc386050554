"""Error of an averaged model, measured over windows in which the full model runs as well.

At the beginning, the middle and the end of the span the full motion starts from the averaged one's state,
with what averaging removed added back, and both are followed. Their difference is a growth, which the
averaged motion carries over the span, plus an oscillation, whatever the span. A run that is hardly longer
than the windows is followed to its end instead. The errors of the integration itself are another matter
(``rigidsim.accuracy.estimates``).
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np

from rigidsim.accuracy.comparison import Collected, compactly
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.average import DIRECTION, Average, osculating
from rigidsim.model.averaged.free_motion import FreeMotion, Wobble
from rigidsim.model.averaged.sources import SlowStart
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import apply, cross, dot, norm
from rigidsim.scene.choices import FULL, MEAN, ORBIT_AVERAGED
from rigidsim.scene.exact import fraction_of
from rigidsim.scene.sample_times import SampleTimes
from rigidsim.scene.scene import Scene
from rigidsim.solve.effects.waypoints import SampleTrail
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem, prepare_scene
from rigidsim.solve.status import Status
from rigidsim.solve.tangents import Derivatives, LostTangents, Place, Tangents
from rigidsim.store.summary import Modelling, ModellingWindow, UnmeasuredCode


class Unmeasured(Exception):
    """The error of an averaged model can't be measured; says why, for decisions and for people."""

    def __init__(self, code: UnmeasuredCode, why: str) -> None:
        super().__init__(why)
        self.code = code


# --- how an averaged motion carries errors ------------------------------------------------------------------

_PART_OF_TURN = math.pi / 6
"""Largest angle of precession within a stretch, over which the path's direction is nearly the same."""
_FEWEST, _MOST = 64, 1024  # stretches
_TOLERANCE = 1e-9  # far below what matters of an error's growth
_STANDS = 1e-13  # rad: a path that is shorter has no direction


def _grown_along(seconds: float, maps: np.ndarray, along: float, across: float) -> float:
    """Largest error (rad) until the end, of a motion that errs by given rates (rad/s) along the path and
    across it all the time, through stretches of some seconds whose maps carry small errors on: what is made
    at different times adds up whatever its sign, which need not stay the same.
    """
    made, largest = np.diag([along, across]) * seconds / 2, 0.0
    errors = np.zeros((2, 0))  # a column for each time and component
    for step in maps:
        # half of a stretch's errors at its beginning, half at its end
        errors = np.hstack([step @ errors, step @ made + made])
        largest = max(largest, math.hypot(*np.abs(errors).sum(axis=1)))
        if largest > math.pi:
            break
    return largest


def _carrying(
    prepared: InitialValueProblem, average: Average, go_on: Callable[[], bool]
) -> tuple[float, np.ndarray]:
    """How an averaged motion carries small errors of its direction on, from its start to its end: steadily,
    in proportion to time, or exponentially, as near a hyperbolic Cassini state. Length of a stretch, s, and
    maps (stretches, 2, 2) of the direction, in components along the path and across it, whose products are
    the maps between any two times. Raises ``Unmeasured`` if ``go_on`` ended it, or it can't be followed.

    The average over the orbits serves where there is one, whose steps are few whatever the run's level; it
    carries errors alike, up to terms that averaging leaves out.
    """
    scene, names, orbits = prepared.scene, ["momentum_axis"], average if average.over_orbits else None
    try:
        problem = in_model(prepared, scene, names, ORBIT_AVERAGED, orbits)
    except ConfigError:
        problem = in_model(prepared, scene, names, average.level, average)
    system = problem.system
    assert system.formulation.average is not None
    average = system.formulation.average
    start, end = float(problem.clock.start), float(problem.clock.at(problem.clock.count - 1))
    seconds = math.ldexp(end - start, system.scaling.time)
    turned = seconds * average.strength * abs(float(average.motion.excess / average.motion.momentum))
    count = int(min(max(turned / _PART_OF_TURN, _FEWEST), _MOST))
    ahead = min(1.0, _PART_OF_TURN * count / max(turned, 1e-300))  # of a stretch
    made, double = Derivatives.of(system), precision_of("double")
    places = [system.states.index(name) for name in DIRECTION]
    moving = made.felt(places)
    few_steps = average.over_orbits or system.wide
    tangents = Tangents(made, moving, 2, double, compact_mode=few_steps, tol=_TOLERANCE)
    own = [moving.index(place) for place in places]
    state = np.array([float(x) for x in system.initial])
    tangents.begin(
        Place((start, 0.0), np.append(state, np.zeros(2 * len(moving))), np.zeros(2, dtype=np.int64))
    )
    bases, moved = [_basis(state[places], np.zeros(3))], []
    for begin, until in pairwise(np.linspace(start, end, count + 1)):
        pushed = np.zeros((2, len(moving)))
        pushed[:, own] = bases[-1]
        tangents.restart(state, pushed)
        before = state
        try:
            ahead_of_it, _ = tangents.to(float(begin + ahead * (until - begin)), go_on)
            state, grown = tangents.to(float(until), go_on)
        except LostTangents:
            why = "motions near the averaged one can't be followed to its end"
            raise Unmeasured(UnmeasuredCode.AVERAGED_STOPPED, why) from None
        except KeyboardInterrupt:
            raise Unmeasured(UnmeasuredCode.INTERRUPTED, "the measurement was interrupted") from None
        path = _basis(before[places], ahead_of_it[places] - before[places], bases[-1][0])
        mixed = path @ bases[-1].T  # the basis along the path, in terms of the one that was pushed
        bases[-1] = path
        moved.append((mixed @ grown[:, own]).T)
        bases.append(_basis(state[places], np.zeros(3), path[0]))
    maps = [after @ step for after, step in zip(bases[1:], moved, strict=True)]
    return seconds / count, np.array(maps)


def _basis(direction: np.ndarray, towards: np.ndarray, otherwise: np.ndarray | None = None) -> np.ndarray:
    """Unit vectors (2, 3) across a direction, the first of them along a path, the second across it."""
    along = towards - (towards @ direction) * direction
    if np.linalg.norm(along) < _STANDS:
        along = np.eye(3)[int(np.argmin(np.abs(direction)))] if otherwise is None else otherwise
        along = along - (along @ direction) * direction
    along = along / np.linalg.norm(along)
    return np.array([along, np.cross(direction, along)])


# --- both models side by side -------------------------------------------------------------------------------

_FEWEST_SAMPLES, _MOST_SAMPLES = 2000, 16_000
_SAMPLES_PER_ROTATION = 2
"""Samples per rotation: near a periapsis, changes within a rotation reach their maximum in a few of them;
with 2000 samples of 7500 rotations a quarter of it was missed.
"""
SIZE, ENERGY = "angular_momentum_norm", "energy"
SHAPE = "energy over the squared momentum"
"""It determines the polhode, and is nearer than either."""
_OF_ROTATION = "rotational_energy"
"""The full model's name for the energy that an averaged one follows, without the potential of gradients."""


@dataclass(frozen=True)
class Change:
    """Difference of a changing quantity between both models, relative to its value: the largest, the mean,
    its growth (1/s), and how far that differs between the window's parts.
    """

    largest: float
    mean: float
    growth: float
    doubt: float


@dataclass(frozen=True)
class Window:
    """What a summary keeps of a window over which both models ran side by side; the largest distances of the
    directions as the run records them, rad (None if the body tumbles); the averaged model's steps; and of a
    motion whose energy and momentum change how far these are from the full model's.
    """

    kept: ModellingWindow
    recorded: float
    recorded_figure: float | None
    reduced_steps: int
    changes: Mapping[str, Change]


def rotation_rates(motion: FreeMotion) -> list[float]:
    """Rates of precession and wobble, rad/s; no wobble of a symmetric body, whose tensor doesn't show it."""
    precession, wobble = Wobble.of(motion).rates
    return [abs(precession), 0.0 if motion.symmetric else abs(wobble)]


def motion_at(average: Average, states: Sequence[Any], exponent: int) -> FreeMotion:
    """Free motion at these states of an averaged motion."""
    if average.driven is None:
        return average.motion
    context = average.driven.torques.scene.context
    axial, transverse = (context.ldexp(x, exponent) for x in states[3:5])
    return average.driven.motion(axial, transverse)


def side_by_side(
    prepared: InitialValueProblem,
    average: Average,
    begin: float,
    end: float,
    states: Sequence[Any],
    go_on: Callable[[], bool],
) -> Window:
    """Run both models side by side. Raises ``Unmeasured`` if one of them is refused, or doesn't reach the
    end.
    """
    exponent = prepared.system.scaling.momentum
    rotations = abs(end - begin) * max(rotation_rates(motion_at(average, states, exponent))) / _TURN
    count = int(min(max(_FEWEST_SAMPLES, _SAMPLES_PER_ROTATION * rotations), _MOST_SAMPLES))
    scene = _starting(prepared, average, begin, end, states, count)
    if begin != float(prepared.scene.start):
        scene = _with_bodies(scene, prepared, states)
    # whether what averaging removed can be added back
    back = average.resonance is None and average.driven is None
    names = ["momentum_axis"] + (["figure_axis"] if average.figure else [])
    driven = average.driven is not None
    steps, true = _followed(prepared, scene, None, False, names + [SIZE, _OF_ROTATION] * driven, go_on)
    reduced_steps, reduced = _followed(prepared, scene, average, back, names + [SIZE, ENERGY] * driven, go_on)
    plain = reduced
    if back and not average.short_period:
        _, plain = _followed(prepared, scene, average, False, names, go_on)
    times = np.linspace(0.0, abs(end - begin), count)
    apart = true["momentum_axis"] - reduced["momentum_axis"]
    path = plain["momentum_axis"]
    growth, doubt = _growth(times, apart @ _basis(path[count // 2], path[-1] - path[0]).T)

    def distances(model: Mapping[str, np.ndarray]) -> tuple[float, float | None]:
        momentum, *figure = (float(np.linalg.norm(true[x] - model[x], axis=1).max()) for x in names)
        return momentum, figure[0] if figure else None

    momentum, figure = distances(reduced)
    kept = ModellingWindow(
        start=begin,
        end=end,
        steps=steps,
        momentum_axis=momentum,
        figure_axis=figure,
        growth_along=float(growth[0]),
        growth_across=float(growth[1]),
        doubt=doubt,
    )
    changes = _changes(times, true, reduced) if driven else {}
    return Window(kept, *distances(plain), reduced_steps, changes)


def _changes(
    times: np.ndarray, true: Mapping[str, np.ndarray], reduced: Mapping[str, np.ndarray]
) -> dict[str, Change]:
    size, energy = (
        true[SIZE].ravel() / reduced[SIZE].ravel(),
        true[_OF_ROTATION].ravel() / reduced[ENERGY].ravel(),
    )
    found, weights = {}, np.hanning(len(times))
    for name, ratio in {SIZE: size, ENERGY: energy, SHAPE: energy / size**2}.items():
        (growth,), doubt = _growth(times, (ratio - 1)[:, None])
        mean = float(weights @ (ratio - 1) / weights.sum())
        found[name] = Change(float(np.abs(ratio - 1).max()), mean, float(growth), doubt)
    return found


def _starting(
    prepared: InitialValueProblem,
    average: Average,
    begin: float,
    end: float,
    states: Sequence[Any],
    count: int,
) -> Scene:
    """The full scene from a time on: the body as at its start, turned by the smallest rotation that brings
    its momentum to the present one; in a resonance, as given by the slow motion; under torques of the body
    alone, on the present polhode.
    """
    scene, exponent = prepared.scene, prepared.system.scaling.momentum
    context = scene.context
    instant = fraction_of(context.mpf(begin)) if begin != float(scene.start) else scene.samples.begin
    step = Fraction(end - begin) / (count - 1)
    samples = SampleTimes(instant, step, None, count, context)
    moved = replace(scene, start=samples.start, end=samples.last, samples=samples)
    if begin == float(scene.start) and scene.config.model.start != MEAN:
        return moved
    if average.resonance is not None:
        slow = SlowStart(list(states[:4]), [scene.context.ldexp(x, exponent) for x in states[4:7]])
        quaternion, velocity = average.resonance.osculating(slow, scene, samples.start)
        return replace(moved, quaternion=quaternion, euler_angles=None, angular_velocity=velocity)
    matrix = attitude.rotation_matrix(scene.quaternion)
    inside = apply(scene.body.inertia, scene.angular_velocity)
    if average.driven is not None:
        inside = average.driven.momentum(*(context.ldexp(x, exponent) for x in states[3:5]))
        moved = replace(moved, angular_velocity=apply(scene.inverse_inertia, inside))
    momentum = apply(matrix, inside)
    size = norm(context, momentum)
    before = [x / size for x in momentum]
    now = osculating(scene, average, states[:3], samples.start)
    turn = [1 + dot(before, now), *cross(before, now)]
    if dot(turn, turn) < context.mpf(2) ** -60:  # to the opposite: about any axis across
        least = min(range(3), key=lambda i: abs(before[i]))
        turn = [context.zero, *cross(before, [context.mpf(i == least) for i in range(3)])]
    quaternion = attitude.product(attitude.unit_quaternion(context, turn), list(scene.quaternion))
    return replace(moved, quaternion=attitude.unit_quaternion(context, quaternion), euler_angles=None)


def _with_bodies(scene: Scene, prepared: InitialValueProblem, states: Sequence[Any]) -> Scene:
    """The scene with its point masses where the averaged motion's states have them."""
    if scene.bodies is None:
        return scene
    system, context = prepared.system, scene.context
    names, exponents = system.states, system.state_exponents
    held = {n: context.ldexp(x, e) for n, x, e in zip(names, states, exponents, strict=True)}
    masses = replace(
        scene.bodies,
        positions=tuple([held[f"{name}_{x}"] for x in "xyz"] for name in scene.bodies.names),
        velocities=tuple([held[f"{name}_v{x}"] for x in "xyz"] for name in scene.bodies.names),
    )
    return replace(scene, bodies=masses, loads=tuple(load.with_point_masses(masses) for load in scene.loads))


def _followed(
    prepared: InitialValueProblem,
    scene: Scene,
    average: Average | None,
    short_period: bool,
    names: list[str],
    go_on: Callable[[], bool],
) -> tuple[int, dict[str, np.ndarray]]:
    """Steps, and the variables asked for at all samples. Raises ``Unmeasured``."""
    level = FULL if average is None else average.level
    words, code = f'level = "{level}" from {float(scene.start):.6g} s on', UnmeasuredCode
    try:
        # what the run averages over is known: a window that decided anew might decide otherwise
        problem = in_model(prepared, scene, names, level, average, short_period=short_period)
    except ConfigError as error:
        why = f"{words} can't be followed: {'; '.join(problem.what for problem in error.problems)}"
        raise Unmeasured(code.FULL_REFUSED if average is None else code.AVERAGED_REFUSED, why) from None
    found = Collected(problem, names, lambda _: None if go_on() else Status.INTERRUPTED)
    progress = found.progress
    if progress.status is Status.INTERRUPTED:
        raise Unmeasured(code.INTERRUPTED, "the measurement was interrupted")
    if progress.status is not Status.FINISHED:
        why = f"{words} ended early: {progress.status.message}"
        raise Unmeasured(code.FULL_STOPPED if average is None else code.AVERAGED_STOPPED, why)
    return progress.steps, {name: found[name][0] for name in names}


def in_model(
    prepared: InitialValueProblem,
    scene: Scene,
    names: list[str],
    level: str,
    average: Average | None,
    *,
    short_period: bool = False,
) -> InitialValueProblem:
    """A scene's motion in a model of some level, in double precision; ``average`` if it is known already."""
    config = scene.config.as_motion(names, precision="double", tolerance="auto", formulation="auto")
    # geodetic precession adds to either alike, tides hardly act within a window, which starts as the full
    # motion does
    update = {
        "level": level,
        "short_period": short_period,
        "start": "osculating",
        "geodetic_precession": False,
    }
    model = config.model.model_copy(update=update)
    plain = replace(scene, config=config.model_copy(update={"model": model, "tides": None}), events=())
    return compactly(prepare_scene(prepared.experiment, plain, loads=prepared.python_loads, along=average))


def _growth(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, float]:
    """Slope of each column, and half of the distance of those over the first two thirds and the last two."""
    third = len(times) // 3
    first, last = _slope(times[: 2 * third], values[: 2 * third]), _slope(times[third:], values[third:])
    return _slope(times, values), float(np.linalg.norm(first - last)) / 2


def _slope(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slope of each column, weighted with a Hann window to suppress oscillations."""
    x = times - times.mean()
    weights = np.sin(np.pi * (times - times[0]) / (times[-1] - times[0])) ** 2
    x = x - (weights @ x) / weights.sum()
    return np.asarray((weights * x) @ values / ((weights * x) @ x))


# --- what they amount to ------------------------------------------------------------------------------------

_ORBITS = 8  # of the slowest source, from which a growth is separated from what goes round with it
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
    time, s, that measuring takes after a run, and the averaged model's steps over the full model's.
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
    span, way = abs(end - begin), scene.samples.direction
    length = min(_length(average, motion_at(average, at_start, exponent)), span)
    whole = span <= _WHOLE * length
    places = [(begin, at_start, length)]
    if not whole:
        places += _places(prepared, average, trail, begin, end, length)
    windows: list[Window] = []
    for at, direction, length in places:
        until = end if whole else at + way * length
        windows.append(side_by_side(prepared, average, at, until, direction, go_on))
    grown = 0.0
    if whole:
        (window,) = windows
        oscillation, figure = window.recorded, window.recorded_figure
        changes = {name: _SPARE_OF_WHOLE * change.largest for name, change in window.changes.items()}
        growth = math.hypot(window.kept.growth_along, window.kept.growth_across)
        how = "every rotation was resolved in a second run to its end"
    else:
        motions = [motion_at(average, states, exponent) for _, states, _ in places]
        steady = average.resonance is not None or not average.sources
        carried = None if steady else _carrying(prepared, average, go_on)
        grown, oscillation = _extrapolated(prepared, average, windows, motions, span, carried)
        figure = max(w.recorded_figure or 0.0 for w in windows) if average.figure else None
        changes, growth = _changed(average, windows, span), grown / span
        share = sum(abs(w.kept.end - w.kept.start) for w in windows) / span
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
    context, unit, way = prepared.scene.context, prepared.clock.unit, prepared.scene.samples.direction
    kept = [] if trail is None else trail.samples
    seen = [(float(time) * unit, [context.mpf(float(x)) for x in state]) for _, time, state, _ in kept]
    seen = [(at, state) for at, state in seen if way * (at - begin) > length]
    found: list[tuple[float, list[Any], float]] = []
    for middle in (True, False):
        if not seen:
            break
        last = length
        if average.driven is not None and not middle:  # a rotation that has become slower takes longer
            last = _length(average, motion_at(average, seen[-1][1], prepared.system.scaling.momentum))
            last = min(max(last, length), abs(end - begin) / 2)
        wanted = (begin + end) / 2 if middle else end - way * last
        near = seen
        if average.driven is not None:  # whose course is known until the end alone
            near = [place for place in seen if way * place[0] <= way * wanted] or seen[:1]
        at, state = min(near, key=lambda place: abs(place[0] - wanted))
        if average.driven is not None:
            last = min(last, abs(end - at))
        if last > 0 and all(at != other for other, _, _ in found):
            found.append((at, state, last))
    return found


def _extrapolated(
    prepared: InitialValueProblem,
    average: Average,
    windows: list[Window],
    motions: Sequence[FreeMotion],
    span: float,
    carried: tuple[float, np.ndarray] | None,
) -> tuple[float, float]:
    """How far the momentum's direction is off at the end, from its growth in windows, and its oscillation."""
    doubts, faster = [w.kept.doubt for w in windows], 0.0
    along = _lasting([w.kept.growth_along for w in windows], doubts)
    across = _lasting([w.kept.growth_across for w in windows], doubts)
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
        grown = _grown_along(*carried, along + faster, across)
    oscillation = max(w.recorded for w in windows)
    if average.driven is not None:  # resonances between the windows
        oscillation += average.driven.passed
    return grown, oscillation


def _changed(average: Average, windows: Sequence[Window], span: float) -> dict[str, float]:
    """Relative errors until the end of quantities that change."""
    if average.driven is None:
        return {}
    largest = {name: max(window.changes[name].largest for window in windows) for name in (SIZE, ENERGY)}
    return {
        name: _SPARE * _grown(windows, name, span) + _SPARE_OF_WHOLE * (most + average.driven.passed)
        for name, most in largest.items()
    }


def _grown(windows: Sequence[Window], name: str, seconds: float) -> float:
    """By how much the relative error of a changing quantity grows."""
    seen = [window.changes[name] for window in windows]
    return _lasting([change.growth for change in seen], [change.doubt for change in seen]) * seconds


def _lasting(rates: Sequence[float], doubts: Sequence[float]) -> float:
    """Size of a rate that was measured in some windows and varies between them, each with its doubt."""
    return abs(float(np.mean(rates))) + (max(rates) - min(rates)) / 2 + max(doubts)
