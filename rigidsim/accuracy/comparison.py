"""Settings compared: a motion integrated in memory under one of them, without files, and how far two
solutions are apart, with every digit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise, zip_longest
from typing import TYPE_CHECKING

import mpmath
import numpy as np

from rigidsim.accuracy.setting import Setting
from rigidsim.errors import ConfigError
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import fraction_of
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.sample_times import SampleTimes
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.solve.assembly import Assembly, assemble
from rigidsim.solve.problem import InitialValueProblem, prepare_scene
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import Check, Progress, SampleReceiver
from rigidsim.solve.status import Status

if TYPE_CHECKING:
    import xarray

# --- trials -------------------------------------------------------------------------------------------------

_REPORT_EVERY = 0.05  # seconds

TrialProgress = Callable[[str, float], None]
"""Receives a setting's title and the progress of its trial (0 to 1), some tens of times per second."""


class Collected(SampleReceiver):
    """A prepared scene taken through its samples, with what is recorded kept in memory.

    Attributes:
        progress: how it ended.
        parts: of the assembly that took it there.
        state: at the last sample.
    """

    def __init__(
        self, prepared: InitialValueProblem, names: Sequence[str], check: Check = lambda _: None
    ) -> None:
        self.parts: Assembly = assemble(prepared)
        self._pieces: dict[str, list[Sequence[np.ndarray]]] = {name: [] for name in names}
        self.progress = self.parts.driver(self, check).run()

    def take(self, block: SampleBlock) -> None:
        """See ``SampleReceiver``."""
        recorded, self.state = self.parts.evaluator.evaluate(block), block.states[-1]
        for name, pieces in self._pieces.items():
            pieces.append(recorded[name])

    def __getitem__(self, name: str) -> list[np.ndarray]:
        """Float64 parts of a variable, its samples first."""
        found = [np.concatenate(part) for part in zip(*self._pieces[name], strict=True)]
        return [np.asarray(part, dtype=np.float64) for part in found]


@dataclass
class Trial:
    """Result of a trial: attitudes and places (m; none without a position) as float64 parts (samples, 4 for
    each body, or 3), and the relative drift (samples,) of each invariant.
    """

    status: Status
    attitudes: list[np.ndarray]
    places: list[np.ndarray]
    histories: dict[str, np.ndarray]
    steps: int
    order: int
    states: int

    @property
    def drifts(self) -> dict[str, float]:
        """Largest drift of each invariant."""
        return {name: float(np.abs(drift).max(initial=0.0)) for name, drift in self.histories.items()}

    @property
    def work(self) -> float:
        """Steps times order squared times states, which doesn't jitter as CPU time does."""
        return float(self.steps) * self.order**2 * self.states


def compared_names(experiment: Experiment) -> tuple[list[str], list[str]]:
    """Names of the attitudes that settings are compared by, and of the path where its accuracy is asked for;
    of two bodies both attitudes, and the place of the second.
    """
    pair, path = bool(experiment.config.rigid_bodies), experiment.config.integrator.accuracy_position
    attitudes = ["quaternion", "rigid_body_quaternion"][: 1 + pair]
    return attitudes, ["rigid_body_position" if pair else "position"] * (path is not None)


def trial_scene(
    experiment: Experiment,
    setting: Setting,
    times: Sequence[mpmath.mpf] | None = None,
    *,
    repeating: bool = False,
) -> Scene:
    """The scene of an experiment under another setting, recording its attitude, and its path where an
    accuracy of that is asked for; ``repeating`` holds invariants as the experiment does. Raises
    ``ConfigError``.
    """
    given, (attitudes, path) = experiment.config.integrator, compared_names(experiment)
    changed = experiment.config.as_motion(
        attitudes + path,
        precision=setting.precision,
        tolerance="auto",
        formulation=setting.formulation,
        hold_invariants=given.hold_invariants if repeating else setting.hold_invariants,
        method=setting.method,
    )
    scene = build_scene(replace(experiment, config=changed))
    if times is None:
        return scene
    exact = [fraction_of(t) for t in times]
    return replace(scene, samples=SampleTimes.listed(scene.samples.begin, exact, scene.context))


def try_setting(
    experiment: Experiment,
    setting: Setting,
    times: Sequence[mpmath.mpf] | None = None,
    *,
    loads: Sequence[Load] = (),
    go_on: Check = lambda _: None,
    report: TrialProgress | None = None,
    compact: bool = False,
    repeating: bool = False,
) -> Trial:
    """Integrate an experiment's motion under a setting, which replaces its ``[integrator]``. Compact code
    compiles in a tenth of the time and takes up to twice as long per step in double precision, as long in the
    others; rounding differs. Raises ``ConfigError`` if the scene can't be integrated so.
    """
    scene = trial_scene(experiment, setting, times, repeating=repeating)
    samples, early = scene.samples, 0
    if samples.times is not None and samples.times[0] != samples.begin:
        # a motion begins at its first sample, which must be its start
        early, whole = 1, [samples.begin, *samples.times]
        scene = replace(scene, samples=SampleTimes.listed(samples.begin, whole, scene.context))
    prepared = prepare_scene(experiment, scene, loads=loads, tolerance=setting.tolerance)
    if compact:
        prepared = compactly(prepared)
    invariants = [invariant.name for invariant in prepared.system.invariants]
    attitudes, path = compared_names(experiment)
    start, length, latest = float(scene.start), float(samples.last - scene.start), 0.0

    def check(progress: Progress) -> Status | None:
        nonlocal latest
        if report is not None and time.monotonic() - latest > _REPORT_EVERY and length:
            latest = time.monotonic()
            report(setting.title, min(1.0, (progress.time - start) / length))
        return go_on(progress)

    found = Collected(prepared, [*attitudes, *path, *(f"{name}_drift" for name in invariants)], check)
    return Trial(
        status=found.progress.status,
        attitudes=side_by_side([found[name] for name in attitudes], early),
        places=[part[early:] for name in path for part in found[name]],
        histories={x: drift.ravel() for x in invariants for drift in found[f"{x}_drift"][:1]},
        steps=found.progress.steps,
        order=found.parts.order or 0,
        states=len(prepared.system.states),
    )


def finished_trial(
    experiment: Experiment,
    setting: Setting,
    times: Sequence[mpmath.mpf],
    loads: Sequence[Load],
    report: TrialProgress | None,
) -> Trial | None:
    """A trial in compact code that reached the last of the times (s, mpf); None if the scene can't be
    integrated with the setting (a chart, a load, no closed form), or not so far.
    """
    with suppress(ConfigError):
        made = try_setting(experiment, setting, times, loads=loads, compact=True, report=report)
        return made if made.status is Status.FINISHED else None
    return None


def compactly(prepared: InitialValueProblem) -> InitialValueProblem:
    """The same problem, to be compiled in compact mode."""
    return replace(prepared, precision=replace(prepared.precision, compact=True))


# --- how far they are apart ---------------------------------------------------------------------------------


def angles_between(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> np.ndarray:
    """Rotation angles (n,) in rad between attitudes given as float64 parts (n, 4) of quaternions; of several
    bodies (n, 4 for each) the largest.

    Small angles keep their digits: parts are subtracted before anything is rounded.
    """
    if (bodies := one[0].shape[1] // 4) > 1:
        rows = [[part.reshape(-1, 4) for part in parts] for parts in (one, other)]
        return angles_between(*rows).reshape(-1, bodies).max(axis=1)
    opposite = np.einsum("ij,ij->i", one[0], other[0]) < 0
    sign = np.where(opposite, -1.0, 1.0)[:, None]
    chord = np.linalg.norm(_differences(one, [sign * part for part in other]), axis=1)
    return np.asarray(4 * np.arcsin(np.minimum(chord / 2, 1.0)))


def side_by_side(attitudes: Sequence[Sequence[np.ndarray]], first: int = 0) -> list[np.ndarray]:
    """Parts (n, 4 for each body) of the attitudes of several bodies, from a row on."""
    return [
        np.concatenate([part.reshape(len(part), -1)[first:] for part in parts], axis=1)
        for parts in zip(*attitudes, strict=True)
    ]


def distances_between(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> np.ndarray:
    """Distances (n,) between positions given as float64 parts (n, 3), subtracted before rounding."""
    return np.asarray(np.linalg.norm(_differences(one, other), axis=1))


def _differences(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> np.ndarray:
    rows = np.stack([*one, *(-part for part in other)], axis=-1)
    return np.array([[math.fsum(parts) for parts in row] for row in rows]).reshape(one[0].shape)


def rotation_vectors(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> np.ndarray:
    """Rotation vectors (n, 3), rad, from the attitudes of one motion to another's, in the body axes of
    the first; of directions the smallest rotations, in space axes, that take one to the other.

    Args:
        one, other: float64 parts (n, 4) of quaternions, or (n, 3) of directions, which are subtracted before
            anything is rounded.
    """
    first, turns, sign = one[0], 1.0, np.ones((len(one[0]), 1))
    if first.shape[1] == 4:
        turns, sign = 2.0, np.where(np.einsum("ij,ij->i", first, other[0]) < 0, -1.0, 1.0)[:, None]
    pairs = zip_longest(one, other, fillvalue=np.zeros_like(first))
    apart = np.sum([sign * b - a for a, b in pairs], axis=0)
    sine = np.cross(first[:, -3:], apart[:, -3:])
    if first.shape[1] == 4:  # vector part of conj(q) dq; conj(q) q has none
        sine = first[:, :1] * apart[:, 1:] - apart[:, :1] * first[:, 1:] - sine
    size = np.linalg.norm(sine, axis=1)
    angle = turns * np.arctan2(size, 1.0 + np.einsum("ij,ij->i", first, apart))
    return np.asarray(sine * np.where(size > 0, angle / np.where(size > 0, size, 1.0), turns)[:, None])


def rows_to_compare(dataset: xarray.Dataset, most: int) -> np.ndarray:
    """All samples, or the one of fastest rotation in each of ``most`` stretches, and the last."""
    count = dataset.sizes["time"]
    if count <= most:
        return np.arange(count)
    rates = np.zeros(count)
    if "angular_velocity" in dataset:
        rates = np.linalg.norm(dataset["angular_velocity"].values, axis=1)
    elif "quaternion" in dataset:
        attitudes = dataset["quaternion"].values
        turned = np.abs(np.einsum("ij,ij->i", attitudes[:-1], attitudes[1:]))
        rates[1:] = np.arccos(np.minimum(turned, 1.0)) / np.abs(np.diff(dataset["time"].values))
    edges = np.linspace(0, count, most).astype(int)
    picked = [a + int(np.argmax(rates[a:b])) for a, b in pairwise(edges)]
    return np.unique([*picked, count - 1])


def exact_times(dataset: xarray.Dataset, rows: np.ndarray) -> list[mpmath.mpf]:
    """Times of some rows, s (mpf)."""
    parts = zip(*parts_of(dataset, "time", rows), strict=True)
    with mpmath.workprec(1200):
        return [mpmath.fsum(float(part) for part in row) for row in parts]


def parts_of(dataset: xarray.Dataset, name: str, rows: np.ndarray) -> list[np.ndarray]:
    """A variable's float64 parts at some rows."""
    return [np.asarray(dataset[part].values[rows]) for part in parts_in(dataset, name)]
