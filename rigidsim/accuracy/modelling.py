"""How wrong an averaged model is: measured over windows in which every rotation is resolved beside it.

At the beginning, the middle and the end of the span the full motion starts from the averaged one's state,
with what averaging removed added back, and both are followed. What they differ by is a growth, which is
extrapolated over the span, and an oscillation, which is there whatever the span. A run that is hardly longer
than the windows is followed to its end instead. The errors of the integration itself are another matter
(``rigidsim.accuracy.estimate``).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from fractions import Fraction
from typing import Any

import numpy as np

from rigidsim.accuracy.trial import compactly
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.average import Average, osculating
from rigidsim.model.averaged.resonance import SlowStart
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import apply, cross, dot, norm
from rigidsim.scene.exact import fraction_of
from rigidsim.scene.model_table import FULL
from rigidsim.scene.records import dataclass
from rigidsim.scene.sample_times import SampleTimes
from rigidsim.scene.scene import Scene
from rigidsim.solve.assembly import assemble, sampler
from rigidsim.solve.evaluate import Evaluator
from rigidsim.solve.problem import InitialValueProblem, prepare_scene
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import Progress, SampleReceiver
from rigidsim.solve.status import Status
from rigidsim.solve.trail import Trail

_SAMPLES = 2000
_ORBITS = 8  # of the slowest source, from which a growth is told from what goes round with it
_FEWEST_ORBITS = 2
_ROTATIONS = 4000  # some 20,000 steps
_MOST_ROTATIONS = 20_000  # for the fewest orbits
_LEAST_ROTATIONS = 50
_LIBRATIONS = 2
_WHOLE = 4  # windows that a run is followed to its end in place of
_SPARE = 2.0
"""Times the extrapolated growth: it is told from three windows, and varies between them."""
_SPARE_OF_WHOLE = 1.25  # for what lies between the samples
_TURN = 2 * math.pi


@dataclass(frozen=True)
class Window:
    """Where both models ran side by side.

    Attributes:
        start, end: seconds.
        steps: of the full model.
        momentum, figure: largest distance between the directions of the angular momentum and of the figure
            axis, with what averaging removed added back, rad; None where the body tumbles.
        recorded, recorded_figure: the same for the directions as the run records them.
        growth: of the distance of the momenta, along and across its precession, rad/s.
        doubt: by how much the growth of the window's parts differs, rad/s.
    """

    start: float
    end: float
    steps: int
    momentum: float
    figure: float | None
    recorded: float
    recorded_figure: float | None
    growth: tuple[float, float]
    doubt: float


@dataclass(frozen=True)
class ModellingError:
    """What a reduced model leaves out.

    Attributes:
        momentum, figure: of the directions recorded, until the end of the run, rad; at most pi.
        growth: rad/s, of the momentum's direction.
        oscillation: rad, which doesn't grow: what isn't added back of the momentum's direction.
        whole: whether the full model was followed to the end.
        how: in words.
        cpu_seconds: that it took.
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

    @property
    def worst(self) -> float:
        """Of both directions."""
        return max(self.momentum, self.figure or 0.0)


def measure_modelling(
    prepared: InitialValueProblem, trail: Trail | None = None, go_on: Callable[[], bool] = lambda: True
) -> ModellingError | None:
    """Measure the modelling error of a run.

    Args:
        trail: some of the run's samples; without them windows lie at the beginning alone.
        go_on: asked again and again; False ends it.

    Returns:
        None where ``go_on`` ended it, or where the full model can't be followed.
    """
    average = prepared.system.plan.average
    assert average is not None
    started = time.process_time()
    scene = prepared.scene
    begin, end = float(scene.start), float(scene.samples.last)
    length = min(_length(scene, average), end - begin)
    whole = end - begin <= _WHOLE * length
    at_start = average.slow_states(prepared.system.scaling.momentum) or list(average.start)
    places = [(begin, at_start)]
    if not whole:
        places += _places(prepared, trail, begin, end, length)
    windows: list[Window] = []
    for at, direction in places:
        until = end if whole else at + length
        try:
            found = _window(prepared, average, at, until, direction, go_on)
        except ConfigError:
            found = None
        if found is None:
            return None
        windows.append(found)
    spent = time.process_time() - started
    if whole:
        return _of_whole(average, windows[0], spent)
    return _extrapolated(prepared, average, windows, end - begin, spent)


def _length(scene: Scene, average: Average) -> float:
    """Of a window, seconds."""
    rates = [abs(float(average.motion.precession_rate)), abs(float(average.motion.wobble_rate))]
    rotation = _TURN / max(rates)
    if average.resonance is not None:
        libration = _TURN / average.resonance.libration_rate
        return max(_ORBITS * _TURN / average.resonance.source.motion, _LIBRATIONS * libration)
    slowest = max((_TURN / s.motion for s in average.sources if s.motion > 0), default=0.0)
    orbits = min(_ORBITS * slowest, _ROTATIONS * rotation)
    least = min(_FEWEST_ORBITS * slowest, _MOST_ROTATIONS * rotation)
    return max(orbits, least, _LEAST_ROTATIONS * _TURN / min(r for r in rates if r > 0))


def _places(
    prepared: InitialValueProblem, trail: Trail | None, begin: float, end: float, length: float
) -> list[tuple[float, list[Any]]]:
    """Middle and end: the samples that are nearest, with the states there, the momentum's direction first."""
    context, exponent = prepared.scene.context, prepared.system.scaling.time
    kept = [] if trail is None else trail.samples
    seen = [
        (math.ldexp(float(time), exponent), [context.mpf(float(x)) for x in state])
        for _, time, state, _ in kept
    ]
    seen = [(at, state) for at, state in seen if at > begin + length]
    found = []
    for wanted in ((begin + end) / 2, end - length):
        if seen:
            nearest = min(seen, key=lambda place: abs(place[0] - wanted))
            if nearest not in found:
                found.append(nearest)
    return found


def _window(
    prepared: InitialValueProblem,
    average: Average,
    begin: float,
    end: float,
    states: Sequence[Any],
    go_on: Callable[[], bool],
) -> Window | None:
    """Both models side by side; None where one doesn't get to the end."""
    exponent = prepared.system.scaling.momentum
    scene = _starting(prepared.scene, average, begin, end, states, exponent)
    back = average.resonance is None  # whether what averaging removed can be added back
    names = ["momentum_axis"] + (["figure_axis"] if average.figure else [])
    full = _followed(prepared, scene, FULL, True, names, go_on)
    reduced = _followed(prepared, scene, average.level, back, names, go_on) if full else None
    plain = reduced
    if reduced and back and not average.short_period:
        plain = _followed(prepared, scene, average.level, False, names, go_on)
    if full is None or reduced is None or plain is None:
        return None
    steps, true = full
    times = np.linspace(0.0, end - begin, _SAMPLES)
    apart = true["momentum_axis"] - reduced[1]["momentum_axis"]
    basis = _basis(plain[1]["momentum_axis"])
    parts = apart @ basis.T
    third = _SAMPLES // 3
    growth = _slope(times, parts)
    first, last = _slope(times[: 2 * third], parts[: 2 * third]), _slope(times[third:], parts[third:])
    return Window(
        begin,
        end,
        steps,
        _largest(apart),
        _largest(true["figure_axis"] - reduced[1]["figure_axis"]) if average.figure else None,
        _largest(true["momentum_axis"] - plain[1]["momentum_axis"]),
        _largest(true["figure_axis"] - plain[1]["figure_axis"]) if average.figure else None,
        (float(growth[0]), float(growth[1])),
        float(np.linalg.norm(first - last)) / 2,
    )


def _starting(
    scene: Scene, average: Average, begin: float, end: float, states: Sequence[Any], exponent: int
) -> Scene:
    """The full scene from a time on: the body as it was at its start, turned by as little as brings its
    momentum to where it is now; as the slow motion has it where it keeps pace with its source.

    Args:
        states: of the averaged motion.
        exponent: binary, of the internal unit of angular momentum.
    """
    context = scene.context
    instant = fraction_of(context.mpf(begin)) if begin != float(scene.start) else scene.samples.begin
    step = Fraction(end - begin) / (_SAMPLES - 1)
    samples = SampleTimes(instant, step, None, _SAMPLES, context)
    moved = replace(scene, start=samples.start, end=samples.last, samples=samples)
    if begin == float(scene.start):
        return moved
    if average.resonance is not None:
        slow = SlowStart(list(states[:4]), scene.context.ldexp(states[4], exponent))
        quaternion, velocity = average.resonance.osculating(slow, scene, samples.start)
        return replace(moved, quaternion=quaternion, euler_angles=None, angular_velocity=velocity)
    matrix = attitude.rotation_matrix(scene.quaternion)
    momentum = apply(matrix, apply(scene.body.inertia, scene.angular_velocity))
    size = norm(context, momentum)
    before = [x / size for x in momentum]
    now = osculating(scene, average, states[:3], samples.start)
    turn = [1 + dot(before, now), *cross(before, now)]
    if dot(turn, turn) < context.mpf(2) ** -60:  # to the opposite: about any axis across
        least = min(range(3), key=lambda i: abs(before[i]))
        other = [context.one if i == least else context.zero for i in range(3)]
        turn = [context.zero, *cross(before, other)]
    quaternion = attitude.product(attitude.unit_quaternion(context, turn), list(scene.quaternion))
    return replace(moved, quaternion=attitude.unit_quaternion(context, quaternion), euler_angles=None)


class _Collected(SampleReceiver):
    """Keeps what is recorded in memory, as doubles."""

    def __init__(self, evaluator: Evaluator, names: Sequence[str]) -> None:
        self._evaluator = evaluator
        self._pieces: dict[str, list[np.ndarray]] = {name: [] for name in names}

    def take(self, block: SampleBlock) -> None:
        recorded = self._evaluator.evaluate(block)
        for name, pieces in self._pieces.items():
            pieces.append(np.asarray(recorded[name][0], dtype=np.float64))

    def of(self, name: str) -> np.ndarray:
        """(samples, 3)."""
        return np.concatenate(self._pieces[name])


def _followed(
    prepared: InitialValueProblem,
    scene: Scene,
    level: str,
    short_period: bool,
    names: list[str],
    go_on: Callable[[], bool],
) -> tuple[int, dict[str, np.ndarray]] | None:
    """Steps, and what was asked for at all samples; None where the motion doesn't get there."""
    config = scene.config
    model = config.model.model_copy(update={"level": level, "short_period": short_period and level != FULL})
    plain = {"precision": "double", "tolerance": "auto", "hold_invariants": False}
    integrator = config.integrator.model_copy(update=plain)
    output = config.output.model_copy(update={"record": names, "lyapunov": False, "timeline": False})
    changed = config.model_copy(update={"model": model, "integrator": integrator, "output": output})
    problem = compactly(prepare_scene(prepared.experiment, replace(scene, config=changed)))
    parts = assemble(problem)
    receiver = _Collected(parts.evaluator, names)

    def check(_: Progress) -> Status | None:
        return None if go_on() else Status.INTERRUPTED

    progress = sampler(problem, parts, receiver, check).run()
    if progress.status is not Status.FINISHED:
        return None
    return progress.steps, {name: receiver.of(name) for name in names}


def _basis(path: np.ndarray) -> np.ndarray:
    """Rows: unit vectors along a path of directions, and across it."""
    middle = path[len(path) // 2]
    along = path[-1] - path[0]
    along = along - (along @ middle) * middle
    if np.linalg.norm(along) < 1e-14:
        along = np.cross(np.eye(3)[int(np.argmin(np.abs(middle)))], middle)
    along = along / np.linalg.norm(along)
    return np.array([along, np.cross(middle, along)])


def _slope(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Of each column, weighted with a Hann window, so that oscillations have little say."""
    x = times - times.mean()
    weights = np.sin(np.pi * (times - times[0]) / (times[-1] - times[0])) ** 2
    x = x - (weights @ x) / weights.sum()
    return np.asarray((weights * x) @ values / ((weights * x) @ x))


def _largest(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=1).max())


def _of_whole(average: Average, window: Window, spent: float) -> ModellingError:
    how = "every rotation was resolved beside the run to its end"
    figure = window.recorded_figure
    return ModellingError(
        average.level,
        min(_SPARE_OF_WHOLE * window.recorded, math.pi),
        None if figure is None else min(_SPARE_OF_WHOLE * figure, math.pi),
        math.hypot(*window.growth),
        window.recorded,
        True,
        how,
        spent,
        [window],
    )


def _extrapolated(
    prepared: InitialValueProblem, average: Average, windows: list[Window], span: float, spent: float
) -> ModellingError:
    rates = np.array([w.growth for w in windows])
    doubt = max(w.doubt for w in windows)
    mean = np.abs(rates.mean(axis=0)) + (rates.max(axis=0) - rates.min(axis=0)) / 2
    along, across = (float(x) + doubt for x in mean)
    # an error across the precession changes its rate, along it
    shear = float(average.shear(prepared.scene.context, prepared.scene.start))
    grown = math.hypot(along + shear * across * span / 2, across) * span
    oscillation = max(w.recorded for w in windows)
    growth = grown / span
    momentum = _SPARE * grown + _SPARE_OF_WHOLE * oscillation
    figure = None
    if average.figure:
        figure = _SPARE * grown + _SPARE_OF_WHOLE * max(w.recorded_figure or 0.0 for w in windows)
        figure = min(figure, math.pi)
    share = sum(w.end - w.start for w in windows) / span
    steps = sum(w.steps for w in windows)
    how = f"every rotation was resolved beside the run in {len(windows)} windows ({100 * share:.2g} % of it, "
    how += f"{steps:,} steps), and the growth found there extrapolated to its end"
    return ModellingError(
        average.level, min(momentum, math.pi), figure, growth, oscillation, False, how, spent, windows
    )
