"""A reduced model and the full one side by side over a window, from the same state."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from rigidsim.accuracy.trial import Collected, compactly
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.average import Average, osculating
from rigidsim.model.averaged.free_motion import FreeMotion
from rigidsim.model.averaged.resonance import SlowStart
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import apply, cross, dot, norm
from rigidsim.scene.choices import FULL
from rigidsim.scene.exact import fraction_of
from rigidsim.scene.sample_times import SampleTimes
from rigidsim.scene.scene import Scene
from rigidsim.solve.problem import InitialValueProblem, prepare_scene
from rigidsim.solve.status import Status
from rigidsim.store.summary_parts import ModellingWindow, UnmeasuredCode

_FEWEST_SAMPLES, _MOST_SAMPLES = 2000, 16_000
_SAMPLES_PER_ROTATION = 2
"""Samples per rotation: near a periapsis, changes within a rotation reach their maximum in a few of them;
with 2000 samples of 7500 rotations a quarter of it was missed.
"""
_TURN = 2 * math.pi
SIZE, ENERGY = "angular_momentum_norm", "energy"
SHAPE = "energy over the squared momentum"
"""It tells the polhode, and is nearer than either."""
_OF_ROTATION = "rotational_energy"
"""The full model's name for the energy that an averaged one follows, without the potential of gradients."""


class Unmeasured(Exception):
    """The error of an averaged model can't be measured; says why, for decisions and for people."""

    def __init__(self, code: UnmeasuredCode, why: str) -> None:
        super().__init__(why)
        self.code = code


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
    """Rates of a free rotation, rad/s."""
    return [abs(float(motion.precession_rate)), abs(float(motion.wobble_rate))]


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
    rotations = (end - begin) * max(rotation_rates(motion_at(average, states, exponent))) / _TURN
    count = int(min(max(_FEWEST_SAMPLES, _SAMPLES_PER_ROTATION * rotations), _MOST_SAMPLES))
    scene = _starting(prepared.scene, average, begin, end, states, exponent, count)
    if begin != float(prepared.scene.start):
        scene = with_bodies(scene, prepared, states)
    # whether what averaging removed can be added back
    back = average.resonance is None and average.driven is None
    names = ["momentum_axis"] + (["figure_axis"] if average.figure else [])
    driven = average.driven is not None
    steps, true = _followed(prepared, scene, None, False, names + [SIZE, _OF_ROTATION] * driven, go_on)
    reduced_steps, reduced = _followed(prepared, scene, average, back, names + [SIZE, ENERGY] * driven, go_on)
    plain = reduced
    if back and not average.short_period:
        _, plain = _followed(prepared, scene, average, False, names, go_on)
    times = np.linspace(0.0, end - begin, count)
    apart = true["momentum_axis"] - reduced["momentum_axis"]
    growth, doubt = _growth(times, apart @ _basis(plain["momentum_axis"]).T)

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
    found, weights = {}, np.hanning(len(times))
    ratios = {
        SIZE: true[SIZE].ravel() / reduced[SIZE].ravel(),
        ENERGY: true[_OF_ROTATION].ravel() / reduced[ENERGY].ravel(),
    }
    ratios[SHAPE] = ratios[ENERGY] / ratios[SIZE] ** 2
    for name, ratio in ratios.items():
        apart = ratio - 1
        (growth,), doubt = _growth(times, apart[:, None])
        mean = float(weights @ apart / weights.sum())
        found[name] = Change(float(np.abs(apart).max()), mean, float(growth), doubt)
    return found


def _starting(
    scene: Scene,
    average: Average,
    begin: float,
    end: float,
    states: Sequence[Any],
    exponent: int,
    count: int,
) -> Scene:
    """The full scene from a time on: the body as at its start, turned by the smallest rotation that brings
    its momentum to the present one; in a resonance, as given by the slow motion; under torques of the body
    alone, on the present polhode.
    """
    context = scene.context
    instant = fraction_of(context.mpf(begin)) if begin != float(scene.start) else scene.samples.begin
    step = Fraction(end - begin) / (count - 1)
    samples = SampleTimes(instant, step, None, count, context)
    moved = replace(scene, start=samples.start, end=samples.last, samples=samples)
    if begin == float(scene.start):
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
        other = [context.one if i == least else context.zero for i in range(3)]
        turn = [context.zero, *cross(before, other)]
    quaternion = attitude.product(attitude.unit_quaternion(context, turn), list(scene.quaternion))
    return replace(moved, quaternion=attitude.unit_quaternion(context, quaternion), euler_angles=None)


def with_bodies(scene: Scene, prepared: InitialValueProblem, states: Sequence[Any]) -> Scene:
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
    return replace(scene, bodies=masses, loads=tuple(load.among(masses) for load in scene.loads))


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
    words = f'level = "{level}" from {float(scene.start):.6g} s on'
    try:
        # what the run averages over is known: a window that decided anew might decide otherwise
        problem = in_model(prepared, scene, names, level, average, short_period=short_period)
    except ConfigError as error:
        code = UnmeasuredCode.FULL_REFUSED if average is None else UnmeasuredCode.AVERAGED_REFUSED
        why = "; ".join(problem.what for problem in error.problems)
        raise Unmeasured(code, f"{words} can't be followed: {why}") from None
    found = Collected(problem, names, lambda _: None if go_on() else Status.INTERRUPTED)
    progress = found.progress
    if progress.status is Status.INTERRUPTED:
        raise Unmeasured(UnmeasuredCode.INTERRUPTED, "the measurement was interrupted")
    if progress.status is not Status.FINISHED:
        code = UnmeasuredCode.FULL_STOPPED if average is None else UnmeasuredCode.AVERAGED_STOPPED
        raise Unmeasured(code, f"{words} ended early: {progress.status.message}")
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
    model = config.model.model_copy(update={"level": level, "short_period": short_period})
    plain = replace(scene, config=config.model_copy(update={"model": model}), events=())
    return compactly(prepare_scene(prepared.experiment, plain, loads=prepared.python_loads, along=average))


def _basis(path: np.ndarray) -> np.ndarray:
    """Unit vectors, as rows, along a path of directions and across it."""
    middle = path[len(path) // 2]
    along = path[-1] - path[0]
    along = along - (along @ middle) * middle
    if np.linalg.norm(along) < 1e-14:
        along = np.cross(np.eye(3)[int(np.argmin(np.abs(middle)))], middle)
    along = along / np.linalg.norm(along)
    return np.array([along, np.cross(middle, along)])


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
