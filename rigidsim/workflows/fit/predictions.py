"""What an experiment predicts at given times, and how that changes with the numbers that are fitted."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from rigidsim.errors import ConfigError, Problem, RigidsimError
from rigidsim.scene.choices import DEFAULT_METHOD
from rigidsim.scene.config import Experiment
from rigidsim.scene.row_rotations import conjugated, multiplied, normalised, vector_of
from rigidsim.solve.by_keys import turned
from rigidsim.solve.problem import prepare
from rigidsim.solve.tangents import LostTangents
from rigidsim.workflows.fit.keys import FitKeys
from rigidsim.workflows.fit.observations import QUATERNION, Observed
from rigidsim.workflows.run import run
from rigidsim.workflows.sensitivity import Tangents

CHANGE = 1e-4
"""Change of what is observed (of attitudes in rad, of others relative to their size) that the steps of
central differences make: what is cut off and the rounding of double runs are a share of 1e-8 of it each.
"""
ALONG = ("quaternion", "angular_velocity", "position")
"""What is predicted along the whole run."""
_ROUNDING = 1e-12  # of runs in double precision, relative to the size of what is observed
_FIRST = 1e-4  # first steps, relative to the size of each number


class NotPredicted(RigidsimError):
    """The motion at these values ends before the last observation, or has no finite values there."""


@dataclass
class Prediction:
    """Predictions at some times.

    Attributes:
        values: by variable, (times, components), SI; quaternions for attitudes.
        slopes: by variable, (times, components, numbers) derivatives; of attitudes by rotation vectors in
            space axes, rad, (times, 3, numbers).
        noise: by variable, (numbers,): of slopes, below which they are rounding.
    """

    values: dict[str, np.ndarray]
    slopes: dict[str, np.ndarray] = field(default_factory=dict)
    noise: dict[str, np.ndarray] = field(default_factory=dict)


class ByDifferences:
    """Runs of the experiment, and central differences between them."""

    how = "central differences of runs"

    def __init__(self, keys: FitKeys, quiet: Experiment, quantities: Sequence[Observed]) -> None:
        self._keys, self._quiet = keys, quiet
        self._variables = {one.variable: one for one in quantities}
        self._steps = _FIRST * np.array([one.size for one in keys.all])
        self._adapted = False

    def at(self, values: Sequence[float], times: np.ndarray) -> Prediction:
        """Predictions with derivatives at ascending times (s).

        Raises:
            NotPredicted: the motion doesn't get there.
        """
        centre = self.values(values, times)
        found = self._differences(values, times, centre)
        if not self._adapted:
            self._adapt(found)
            found = self._differences(values, times, centre)
        return found

    def along(self, values: Sequence[float], times: np.ndarray) -> Prediction:
        """The same of attitude, angular velocity and position, as far as the scene has them."""
        names = []
        for name in ALONG:
            with suppress(ConfigError):
                prepare(self._quiet.quiet([name]))
                names.append(name)
        if not names:
            return Prediction({})
        forms = {"quaternion": "quaternion"}
        found = [Observed(name, name, forms.get(name, "plain"), (), None) for name in names]
        return ByDifferences(self._keys, self._quiet.quiet(names), found).at(values, times)

    def values(self, values: Sequence[float] | np.ndarray, times: np.ndarray) -> dict[str, np.ndarray]:
        """Predictions alone."""
        try:
            changed = self._keys.experiment(values, self._quiet)
            made = run(
                changed.quiet(self._quiet.config.output.record, times.tolist(), events=[], fit=None),
                out=None, progress=False,
            )  # fmt: skip
        except ConfigError as error:
            raise NotPredicted(f"the experiment can't be run at these values: {error}") from None
        dataset = made.dataset
        if dataset.sizes["time"] != len(times):
            raise NotPredicted(f"the motion {made.outcome.message} before the last observation")
        found = {}
        for name in self._variables:
            value = dataset[name].values
            found[name] = value.reshape(len(times), -1)
            if not np.isfinite(found[name]).all():
                raise NotPredicted(f"{name} has no finite value at each observation")
        return found

    def _differences(
        self, values: Sequence[float], times: np.ndarray, centre: dict[str, np.ndarray]
    ) -> Prediction:
        found = Prediction(centre)
        slopes: dict[str, list[np.ndarray]] = {name: [] for name in self._variables}
        for n, step in enumerate(self._steps):
            ends = []
            for sign in (-1, 1):
                moved = np.array(values, dtype=float)
                moved[n] += sign * step
                ends.append((moved[n], self.values(moved, times)))
            width = ends[1][0] - ends[0][0]
            for name, one in self._variables.items():
                before, after = ends[0][1][name], ends[1][1][name]
                slopes[name].append(difference(one, before, after) / width)
        for name, parts in slopes.items():
            found.slopes[name] = np.stack(parts, axis=2)
            size = self._size(name, centre)
            found.noise[name] = _ROUNDING * size / self._steps
        return found

    def _size(self, name: str, centre: dict[str, np.ndarray]) -> float:
        one = self._variables[name]
        return 1.0 if one.rotation or one.form == "angle" else float(np.abs(centre[name]).max()) or 1.0

    def _adapt(self, found: Prediction) -> None:
        """Steps that change what is observed by ``CHANGE``."""
        for n, step in enumerate(self._steps):
            largest = max(
                float(np.abs(found.slopes[name][:, :, n]).max()) / self._size(name, found.values)
                for name in self._variables
            )
            wanted = CHANGE / largest if largest > 0 else np.inf
            self._steps[n] = min(max(wanted, 1e-4 * step), 100 * step)
        self._adapted = True


class ByTangents:
    """Variational equations beside the motion, compiled once for all values: side by side where a motion
    allows it, otherwise one step after the other.
    """

    how = "variational equations"

    def __init__(self, keys: FitKeys, quiet: Experiment, quantities: Sequence[Observed]) -> None:
        self._names = list(dict.fromkeys(one.variable for one in quantities))
        self._keys = [one.key for one in keys.all]
        self._sizes = np.array([one.size for one in keys.all])
        integrator = quiet.config.integrator.model_copy(update={"method": DEFAULT_METHOD})
        stepping = replace(quiet, config=quiet.config.model_copy(update={"integrator": integrator}))
        if prepare(stepping).system.wide:
            what = "its equations are so many that to differentiate them takes longer than the runs"
            raise ConfigError(Problem("[fit] parameters", what))
        self._source = Tangents(
            stepping, self._keys, record=self._names, quickly=True, where="[fit] parameters"
        )

    def at(self, values: Sequence[float], times: np.ndarray, names: Sequence[str] = ()) -> Prediction:
        """Predictions with derivatives at ascending times (s).

        Args:
            names: of variables, as far as the scene has them; by default those observed.

        Raises:
            NotPredicted: the motion doesn't get there.
        """
        given = {key: float(value) for key, value in zip(self._keys, values, strict=True)}
        try:
            rows = self._source.rows(given, times)
        except LostTangents as error:
            raise NotPredicted(f"{error}") from None
        except ConfigError as error:
            raise NotPredicted("; ".join(problem.what for problem in error.problems)) from None
        made = Prediction({})
        for name in names or self._names:
            if name not in rows.values:
                continue
            value = rows.values[name].astype(float)
            made.values[name] = normalised(value) if name == QUATERNION else value
            slopes = rows.slopes[name]  # (n, keys, components)
            slopes = turned(rows.values[name], slopes) if name == QUATERNION else slopes
            made.slopes[name] = np.ascontiguousarray(slopes.astype(float).transpose(0, 2, 1))
            size = 1.0 if name == QUATERNION else float(np.abs(value).max()) or 1.0
            made.noise[name] = _ROUNDING * size / self._sizes
            if not (np.isfinite(value).all() and np.isfinite(made.slopes[name]).all()):
                raise NotPredicted(f"{name} has no finite value at each observation")
        return made

    def along(self, values: Sequence[float], times: np.ndarray) -> Prediction:
        """The same, with attitude, angular velocity and position, as far as the scene has them."""
        return self.at(values, times, names=ALONG)


def difference(quantity: Observed, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """From one value to another, (rows, components); of attitudes the rotation vector in space axes."""
    if quantity.rotation:
        return vector_of(multiplied(other, conjugated(one)))
    apart = other - one
    return np.asarray(np.remainder(apart + np.pi, 2 * np.pi) - np.pi) if quantity.form == "angle" else apart


Predictor = ByDifferences | ByTangents
