"""The models that are compared: run folders that go on where they were left, attitudes, and sizes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import zip_longest
from pathlib import Path

import heyoka as hy
import numpy as np

from rigidsim.accuracy.choice import chosen
from rigidsim.accuracy.comparison import parts_of
from rigidsim.errors import FORCE, OUT, ConfigError, RunFolderError
from rigidsim.scene.choices import REDUCED
from rigidsim.scene.config import Experiment
from rigidsim.session.session import Tuning
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.store.folder import RunFolder
from rigidsim.store.run import SavedRun
from rigidsim.store.summary import Summary
from rigidsim.workflows.physics.effects import PhysicalEffect, effects_of, outermost, without
from rigidsim.workflows.resume import resume
from rigidsim.workflows.run import run

FULL_MODEL = "full"
ATTITUDE = "quaternion"
AXES = ("figure_axis", "momentum_axis")
_LONGEST = 80  # of a run's name
_ACCURACY = ("accuracy", "accuracy_axis", "accuracy_position")


def rotation_vectors(one: list[np.ndarray], other: list[np.ndarray]) -> np.ndarray:
    """Rotation vectors (n, 3), rad, in the body axes of the first, from the attitudes of one motion to those
    of another; given as float64 parts (n, 4) of quaternions, and subtracted before anything is rounded.
    """
    sign = np.where(np.einsum("ij,ij->i", one[0], other[0]) < 0, -1.0, 1.0)[:, None]
    apart = _differences(one, [sign * part for part in other])
    w, v, dw, dv = one[0][:, :1], one[0][:, 1:], apart[:, :1], apart[:, 1:]
    sine = w * dv - dw * v - np.cross(v, dv)  # vector part of conj(q) dq; that of conj(q) q is zero
    cosine = 1.0 + (w * dw)[:, 0] + np.einsum("ij,ij->i", v, dv)
    size = np.linalg.norm(sine, axis=1)
    angle = 2.0 * np.arctan2(size, cosine)
    return sine * np.where(size > 0, angle / np.where(size > 0, size, 1.0), 2.0)[:, None]


def axis_vectors(one: list[np.ndarray], other: list[np.ndarray]) -> np.ndarray:
    """The same of directions (n, 3): the smallest rotations, in space axes, that take one to the other."""
    apart = _differences(one, other)
    sine = np.cross(one[0], apart)
    size = np.linalg.norm(sine, axis=1)
    angle = np.arctan2(size, 1.0 + np.einsum("ij,ij->i", one[0], apart))
    return sine * np.where(size > 0, angle / np.where(size > 0, size, 1.0), 1.0)[:, None]


def _differences(one: list[np.ndarray], other: list[np.ndarray]) -> np.ndarray:
    pairs = zip_longest(one, other, fillvalue=np.zeros_like(one[0]))
    return np.sum([b - a for a, b in pairs], axis=0)


@dataclass(frozen=True)
class ModelRun:
    """A model that was run.

    Attributes:
        rotations: rotation vectors (n, 3), rad, from the full model's attitudes to its own.
        steps, cpu_seconds: what it took.
        operations: of its equations.
        uncertainty: of its own attitude at the end by rounding, rad; None if not estimated.
    """

    folder: Path
    rotations: np.ndarray
    steps: int
    cpu_seconds: float
    operations: int
    uncertainty: float | None

    @property
    def cost(self) -> int:
        """Steps times operations; of a closed form, which has no steps, the operations."""
        return max(self.steps, 1) * self.operations

    @property
    def largest(self) -> float:
        """Largest angle from the full model, rad."""
        return float(np.linalg.norm(self.rotations, axis=1).max())

    @property
    def rms(self) -> float:
        """The same, in the mean over the samples."""
        return float(np.sqrt(np.mean(np.sum(self.rotations**2, axis=1))))


@dataclass
class Models:
    """The full model of an experiment and those without some of its effects, as runs in one folder."""

    given: Experiment
    folder: Path
    force: bool
    tuning: Tuning | None
    told: Callable[[str], None]
    _done: dict[tuple[str, ...], ModelRun] = field(default_factory=dict)
    _full: list[np.ndarray] = field(default_factory=list)

    @cached_property
    def effects(self) -> Mapping[str, PhysicalEffect]:
        """What can be left out, by code."""
        return effects_of(self.given.config)

    @cached_property
    def compared(self) -> str:
        """The variable that is compared: the attitude, or the axis of an average, which keeps no attitude."""
        if self.given.config.model.level not in REDUCED:
            return ATTITUDE
        try:
            prepare(self.given.having([f'output.record=["{AXES[0]}"]']))
        except ConfigError:
            return AXES[1]
        return AXES[0]

    @cached_property
    def experiment(self) -> Experiment:
        """The full model: settings chosen, nothing recorded but what is compared."""
        config = self.given.config
        settled, _ = chosen(self.given)
        asked = [f"integrator.{key}=" for key in _ACCURACY if key in config.integrator.model_fields_set]
        shown = [
            f"output.{key}="
            for key in ("tip", "lyapunov", "sensitivity")
            if key in config.output.model_fields_set
        ]
        kept = [f'output.record=["{self.compared}"]', "output.timeline=false", "output.estimate=true"]
        return settled.having([*asked, *shown, *kept])

    def model(self, codes: Collection[str]) -> Experiment:
        """The experiment without some effects, named by these."""
        left_out = outermost(self.effects, codes)
        name = f"without-{'-'.join(left_out)}" if left_out else FULL_MODEL
        if len(name) > _LONGEST:
            name = f"{name[: _LONGEST - 9]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
        estimate = [] if not left_out else ["output.estimate=false"]
        return without(self.experiment, left_out).having([f'name="{name}"', *estimate])

    def run(self, codes: Collection[str]) -> ModelRun:
        """A model's run: done before, gone on with, or begun."""
        key = tuple(outermost(self.effects, codes))
        if key not in self._done:
            self._done[key] = self._run(key)
        return self._done[key]

    def _run(self, codes: tuple[str, ...]) -> ModelRun:
        model = self.model(codes)
        done = self._settled(model)
        if not isinstance(done.outcome, Summary) or done.status != "finished":
            raise RunFolderError(
                f"{done.place}: ended as {done.status} ({done.summary.get('message', '')}), and models are "
                "compared over the whole span; give it the time or steps that it needs, and call this again"
            )
        with done.dataset as dataset:
            found = parts_of(dataset, self.compared, np.arange(dataset.sizes["time"]))
        if not codes:
            self._full = found
        apart = rotation_vectors if self.compared == ATTITUDE else axis_vectors
        cost = done.outcome.cost
        return ModelRun(
            self.folder / model.config.name,
            apart(self._full, found),
            cost.steps,
            cost.cpu_seconds,
            size_of(prepare(model)),
            done.outcome.accuracy.estimated_attitude_error,
        )

    def _settled(self, model: Experiment) -> SavedRun:
        """The run of a model, whatever of it there is already."""
        name = model.config.name
        folder = RunFolder(self.folder / name)
        begun = folder.config.exists() and (folder.dataset.exists() or folder.segments.exists())
        if begun and folder.config.read_text(encoding="utf-8") == model.text:
            if not folder.dataset.exists():
                self.told(f"{name}: goes on")
            return resume(folder.path, tuning=self.tuning, progress=False)
        if begun and not self.force:
            raise RunFolderError(
                f"{folder.path}: holds the run of another config; {FORCE} replaces it, another {OUT} puts "
                "these runs elsewhere"
            )
        self.told(f"{name}: begun")
        return run(model, out=self.folder, force=begun, tuning=self.tuning, progress=False)


def size_of(prepared: InitialValueProblem) -> int:
    """Operations of the compiled equations, each part counted once."""
    equations = prepared.system.equations
    function = hy.cfunc(
        [right for _, right in equations],
        [variable for variable, _ in equations],
        compact_mode=True,
        **prepared.precision.options,
    )
    return len(function.dc) - 2 * len(equations)
