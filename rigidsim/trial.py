"""A motion integrated in memory, nothing written: for comparing settings with one another.

Attitudes are compared in more digits than a double has, so that errors far below 1e-16 can be told.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from typing import Any

import mpmath
import numpy as np

from rigidsim.assembly import assemble
from rigidsim.prepare import Prepared, prepare_scene
from rigidsim.scene.reading import Experiment
from rigidsim.scene.scene import SampleTimes, Scene, build_scene
from rigidsim.solve.advance import Advance, Progress
from rigidsim.solve.closed.direct import Direct
from rigidsim.solve.harvest import Checkpoint
from rigidsim.solve.status import Status

_TOLD_EVERY = 0.05  # seconds


@dataclass(frozen=True)
class Setting:
    """How to integrate: the keys of ``[integrator]`` that trade speed for accuracy.

    Attributes:
        precision: as in a config.
        tolerance: None for "auto".
    """

    precision: str | int = "double"
    tolerance: float | None = None
    formulation: str = "quaternion"
    hold_invariants: bool = False
    method: str = "taylor"

    @property
    def title(self) -> str:
        """For tables."""
        if self.method == "closed_form":
            return f"closed form, {self.precision}"
        digits = f"{self.precision} digits" if isinstance(self.precision, int) else self.precision
        tolerance = "" if self.tolerance is None else f", tolerance {self.tolerance:.0e}"
        return f"{digits}{tolerance}, {self.formulation}{', held' if self.hold_invariants else ''}"

    def overrides(self) -> list[str]:
        """As ``KEY=VALUE`` texts for ``rigidsim.load``."""
        precision = self.precision if isinstance(self.precision, int) else f'"{self.precision}"'
        tolerance = '"auto"' if self.tolerance is None else f"{self.tolerance!r}"
        return [
            f"integrator.precision={precision}",
            f"integrator.tolerance={tolerance}",
            f'integrator.formulation="{self.formulation}"',
            f"integrator.hold_invariants={'true' if self.hold_invariants else 'false'}",
            f'integrator.method="{self.method}"',
        ]


@dataclass
class Trial:
    """What a trial gave.

    Attributes:
        setting: that it was made with.
        seconds: of the samples, internal units don't matter here: exact mpf.
        attitudes: float64 parts of the quaternions, each (samples, 4).
        drifts: largest relative drift of each invariant at the samples.
        histories: relative drift (samples,) of each invariant.
        cpu_seconds: of the integration alone; compile_seconds: before it.
        work: steps times Taylor order squared times states: a count that doesn't jitter.
    """

    setting: Setting
    status: Status
    attitudes: list[np.ndarray]
    drifts: dict[str, float]
    steps: int
    order: int
    cpu_seconds: float
    compile_seconds: float
    work: float
    rows: int = field(default=0)
    histories: dict[str, np.ndarray] = field(default_factory=dict)


class _Collected:
    """Keeps everything in memory."""

    def __init__(self, prepared: Prepared, evaluator: Any) -> None:
        self._prepared, self._evaluator = prepared, evaluator
        self.pieces: list[list[np.ndarray]] = []
        self.drifts: dict[str, float] = {}
        self.histories: dict[str, list[np.ndarray]] = {}

    def take(
        self, first: int, times: np.ndarray, states: np.ndarray, turns: np.ndarray, put_back: np.ndarray
    ) -> None:
        recorded = self._evaluator.evaluate(states, turns)
        self.pieces.append(recorded["quaternion"])
        for invariant in self._prepared.system.invariants:
            drift = recorded[f"{invariant.name}_drift"][0]
            self.histories.setdefault(invariant.name, []).append(np.asarray(drift, dtype=np.float64).ravel())
            largest = float(np.max(np.abs(drift)))
            self.drifts[invariant.name] = max(largest, self.drifts.get(invariant.name, 0.0))

    def due(self) -> bool:
        return False

    def save(self, checkpoint: Checkpoint) -> None:
        """Never due."""


def setting_of(experiment: Experiment) -> Setting:
    """The setting that an experiment's ``[integrator]`` stands for."""
    integrator = experiment.config.integrator
    tolerance = integrator.tolerance
    return Setting(
        integrator.precision,
        None if isinstance(tolerance, str) else float(tolerance.rational),
        "quaternion" if integrator.formulation in ("auto", "rates") else integrator.formulation,
        integrator.hold_invariants,
        integrator.method,
    )


def trial_scene(experiment: Experiment, setting: Setting, times: Sequence[Any] | None = None) -> Scene:
    """The scene of an experiment under another setting, recording its attitude alone.

    Args:
        times: where to sample, mpf seconds in ascending order; None keeps the experiment's.

    Raises:
        ConfigError: the scene can't be integrated so.
    """
    config = experiment.config
    integrator = config.integrator.model_copy(
        update={
            "precision": setting.precision,
            "tolerance": "auto",
            "formulation": setting.formulation,
            "hold_invariants": setting.hold_invariants,
            "method": setting.method,
            "accuracy": None,
        }
    )
    output = config.output.model_copy(update={"record": ["quaternion"], "lyapunov": False, "timeline": False})
    changed = config.model_copy(update={"integrator": integrator, "output": output, "events": []})
    scene = build_scene(replace(experiment, config=changed))
    if times is None:
        return scene
    exact = [scene.context.mpf(t) for t in times]
    start = scene.samples.start
    return replace(scene, samples=SampleTimes(start, exact[-1] - start, 0, exact, len(exact)))


def try_setting(
    experiment: Experiment,
    setting: Setting,
    times: Sequence[Any] | None = None,
    *,
    loads: Sequence[Any] = (),
    go_on: Callable[[Progress], Status | None] | None = None,
    told: Callable[[str, float], None] | None = None,
    compact: bool = False,
) -> Trial:
    """Integrate an experiment's motion under a setting.

    Args:
        experiment: gives the scene; its own ``[integrator]`` is replaced by the setting.
        times: where to sample, mpf seconds; None keeps the experiment's.
        loads: given from Python.
        go_on: asked between chunks; a status ends the trial.
        told: the setting's title, and how far the trial has come (0 to 1), some tens of times per second.
        compact: compiled in a tenth of the time to code that takes up to twice as long a step in double
            precision, and as long in the others; rounding differs.

    Raises:
        ConfigError: the scene can't be integrated so (no closed form, nothing to hold, ...).
    """
    started = time.process_time()
    scene = trial_scene(experiment, setting, times)
    samples, early = scene.samples, 0
    if samples.times is not None and samples.times[0] > samples.start:
        # a motion begins at its first sample, which must be its start
        early, whole = 1, [samples.start, *samples.times]
        scene = replace(scene, samples=replace(samples, times=whole, count=len(whole)))
    prepared = prepare_scene(experiment, scene, loads=loads, tolerance=setting.tolerance)
    if compact:
        prepared = compactly(prepared)
    parts = assemble(prepared)
    keeper = _Collected(prepared, parts.evaluator)
    check = go_on or (lambda _: None)
    if told is not None:
        told(setting.title, 0.0)
        check = _telling(check, told, setting.title, float(scene.start), float(samples.last))
    clock, precision = prepared.clock, prepared.precision
    advance: Advance | Direct
    if prepared.closed is not None:
        advance = Direct(prepared.closed, prepared.system, parts.rhythm, clock, precision, keeper, check)
    else:
        advance = Advance(parts.rhythm, clock, precision, keeper, check)
    built = time.process_time()
    progress = advance.run()
    ended = time.process_time()
    order = int(parts.stepper.integrator.order)
    attitudes = [np.concatenate(part)[early:] for part in zip(*keeper.pieces, strict=True)]
    return Trial(
        setting=setting,
        status=progress.status,
        attitudes=attitudes,
        drifts=keeper.drifts,
        steps=progress.steps,
        order=order,
        cpu_seconds=ended - built,
        compile_seconds=built - started,
        work=float(progress.steps) * order**2 * len(prepared.system.states),
        rows=max(progress.next_sample - early, 0),
        histories={name: np.concatenate(pieces) for name, pieces in keeper.histories.items()},
    )


def _telling(
    check: Callable[[Progress], Status | None],
    told: Callable[[str, float], None],
    title: str,
    start: float,
    last: float,
) -> Callable[[Progress], Status | None]:
    """A check between chunks that also tells how far a trial has come."""
    latest = time.monotonic()

    def both(progress: Progress) -> Status | None:
        nonlocal latest
        now = time.monotonic()
        if now - latest > _TOLD_EVERY and last > start:
            latest = now
            told(title, min(1.0, (progress.time - start) / (last - start)))
        return check(progress)

    return both


def compactly(prepared: Prepared) -> Prepared:
    """The same, to be compiled in compact mode."""
    return replace(prepared, precision=replace(prepared.precision, compact=True))


def angles_between(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> np.ndarray:
    """Rotation angles (n,) in rad between attitudes given as float64 parts (n, 4) of quaternions.

    Small angles keep their digits: parts are subtracted before anything is rounded.
    """
    lead = np.einsum("ij,ij->i", one[0], other[0])
    sign = np.where(lead < 0, -1.0, 1.0)[:, None]
    terms = [*one, *(-sign * b for b in other)]
    if len(terms) <= 4:
        pairs = zip_longest(one, other, fillvalue=np.zeros_like(one[0]))
        difference = sum((a - sign * b for a, b in pairs), np.zeros_like(one[0]))
    else:  # differences of single parts are rounded at 1e-32 already
        difference = np.array([math.fsum(row) for row in np.stack(terms, axis=-1).reshape(-1, len(terms))])
        difference = difference.reshape(one[0].shape)
    chord = np.linalg.norm(difference, axis=1)
    return 4 * np.arcsin(np.minimum(chord / 2, 1.0))


def spread_times(experiment: Experiment, count: int, until: float = 1.0) -> list[Any]:
    """Up to ``count`` times over the first part ``until`` of a run, its end included, as mpf.

    Each is a double, so that every precision from double on means the same moment by it.
    """
    scene = build_scene(experiment)
    start, last = float(scene.start), float(scene.samples.last)
    grid = start + (last - start) * until * np.arange(1, count + 1) / count
    return [mpmath.mpf(float(t)) for t in grid]
