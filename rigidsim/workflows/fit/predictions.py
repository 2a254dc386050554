"""The parameters of a fit, keys of the config as single numbers; what the experiment predicts at other values
of them, and how that changes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem, RigidsimError
from rigidsim.scene.choices import DEFAULT_METHOD
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import parse_number
from rigidsim.scene.row_rotations import conjugated, multiplied, of_vector, vector_of
from rigidsim.scene.scene import build_scene
from rigidsim.scene.schema import KnownWithin
from rigidsim.scene.units import powers, unit_text
from rigidsim.scene.validation_messages import shown
from rigidsim.scene.varied_keys import ATTITUDE, VariedKey, varied_keys
from rigidsim.solve.problem import prepare
from rigidsim.workflows.fit.observations import QUATERNION, Observed
from rigidsim.workflows.read import refuse_backwards
from rigidsim.workflows.run import run
from rigidsim.workflows.sensitivity import Tangents

_FORMS = ("euler_angles", "pole", "prime_meridian", "obliquity", "node_longitude")


@dataclass(frozen=True)
class FitKey:
    """One number that is estimated or considered.

    Attributes:
        key: dotted, with its index: ``initial.angular_velocity[2]``.
        unit: SI unit of its values, "1" for none.
        start: the config's value, SI. sigma: known beforehand, SI; None for nothing.
        suffix: unit with which values are written into the config, where they have one there.
        places: keys of the config where it stands. size: against which changes of it are small or not.
    """

    key: str
    unit: str
    start: float
    sigma: float | None = None
    suffix: str = ""
    places: tuple[str, ...] = ()
    size: float = 1.0


class FitKeys:
    """All numbers of a fit, estimated ones first, each in the order of the config.

    Attributes:
        estimated: keys in ``[fit] parameters``. considered: keys in ``[fit] consider``.
        scene: of the config's values.
    """

    def __init__(self, experiment: Experiment) -> None:
        table = experiment.config.fit
        assert table is not None
        self._experiment = experiment
        self.scene = build_scene(experiment)
        refuse_backwards(self.scene, experiment.source)
        self.estimated = self._all("parameters", table.parameters, "prior", table.prior)
        self.considered = self._all("consider", list(table.consider), "consider", table.consider)
        self._turned = any(one.key.startswith(ATTITUDE) for one in self.all)

    @property
    def all(self) -> tuple[FitKey, ...]:
        """Estimated ones, then considered ones."""
        return (*self.estimated, *self.considered)

    # --- reading --------------------------------------------------------------------------------------------

    def _all(
        self, where: str, keys: Sequence[str], known: str, sigmas: Mapping[str, KnownWithin]
    ) -> tuple[FitKey, ...]:
        every = varied_keys(self._experiment, keys, f"[fit] {where}")
        found, problems = {one.name: self._one(one) for one in every}, []
        for key, table in sorted(sigmas.items(), key=lambda item: len(item[0])):  # components override
            plain = key.replace(" ", "")
            members = [one for one in every if one.name == plain or one.name.startswith(f"{plain}[")]
            given = table.sigma if isinstance(table.sigma, list) else [table.sigma] * len(members)
            try:
                if not members:
                    raise ValueError("is not among the parameters; name it there, or remove its prior")
                if len(given) != len(members):
                    raise ValueError(f"given {shown(given)} as sigma; one for each component is needed")
                for one, value in zip(members, given, strict=True):
                    sigma = _sigma(value, one, self._parameter(one))
                    found[one.name] = replace(found[one.name], sigma=sigma)
            except ValueError as error:
                problems.append(Problem(f'[fit] {known}."{key[:60]}"', str(error)))
        if problems:
            raise ConfigError(problems, self._experiment.source)
        return tuple(found.values())

    def _parameter(self, varied: VariedKey) -> Any:
        table, _, name = varied.name.partition(".")
        return self._experiment.config.parameters.get(name) if table == "parameters" else None

    def _one(self, varied: VariedKey) -> FitKey:
        suffix, unit, given = "", varied.unit, self._parameter(varied)
        if given is not None and given.unit:  # constants of expressions have units of their own
            found = unit_text(powers(given.unit)) or "rad"
            suffix = unit = f"rad{found[1:]}" if found.startswith("1/") else found
        places = tuple(str(place) for place in varied.places)
        size = abs(float(varied.number)) or abs(float(varied.size)) or 1.0
        return FitKey(varied.name, unit, float(varied.number), None, suffix, places, size)

    # --- other values ---------------------------------------------------------------------------------------

    def overrides(self, values: Sequence[float] | np.ndarray) -> list[str]:
        """``KEY=VALUE`` texts of values in the order of ``all``, every digit of the doubles written."""
        found = []
        turn = np.zeros(3)
        for one, value in zip(self.all, values, strict=True):
            if one.key.startswith(ATTITUDE):
                turn[int(one.key[-2])] = value
            else:
                number = repr(float(value))
                text = f'"{number} {one.suffix}"' if one.suffix else number
                found += [f"{place}={text}" for place in one.places]
        return [*(self._start(turn) if self._turned else ()), *found]

    def _start(self, turn: np.ndarray) -> list[str]:
        """The attitude at the start turned by a rotation vector, instead of whatever gives it."""
        initial = self.scene.config.initial
        given = np.array([float(x) for x in self.scene.quaternion])
        quaternion = multiplied(given[None, :], of_vector(turn[None, :]))[0]
        texts = [f"initial.{name}=" for name in _FORMS if getattr(initial, name) is not None]
        if initial.spin_period is not None:
            rates = ", ".join(repr(float(w)) for w in self.scene.angular_velocity)
            texts += ["initial.spin_period=", f"initial.angular_velocity=[{rates}]"]
        shown_values = ", ".join(repr(float(x)) for x in quaternion)
        return [*texts, f"initial.quaternion=[{shown_values}]"]

    def experiment(self, values: Sequence[float] | np.ndarray, base: Experiment) -> Experiment:
        """An experiment at other values, without a text of its own: for runs that nobody keeps."""
        varied = self._experiment.having(self.overrides(values), writes=False)
        return replace(base, config=varied.config)

    def fitted(self, values: Sequence[float] | np.ndarray) -> Experiment:
        """The config with estimated values written in, and without ``[fit]``."""
        everything = [*values, *(one.start for one in self.considered)]
        return self._experiment.having(["fit=", *self.overrides(everything)])


def _sigma(given: Any, varied: VariedKey, parameter: Any) -> float:
    """A standard deviation in SI, of a key or of a parameter."""
    anything = varied.name.startswith(("parameters", "states")) and varied.unit == "1"
    number = parse_number(given, "" if anything else varied.unit)
    needed = parameter.unit if parameter is not None else ""
    if number.unit and needed and powers(number.unit) != powers(needed):
        raise ValueError(f"given {shown(given)}, where {needed}, the parameter's unit, is needed")
    if not float(number) > 0:
        raise ValueError(f"given {shown(given)} as sigma; a standard deviation above zero is allowed")
    return float(number)


# --- predictions --------------------------------------------------------------------------------------------

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
            rows = self._source.at(given, times)
        except ConfigError as error:
            raise NotPredicted("; ".join(problem.what for problem in error.problems)) from None
        made = Prediction({})
        for name in names or self._names:
            if name not in rows.values:
                continue
            value = made.values[name] = rows.values[name]
            made.slopes[name] = np.ascontiguousarray(rows.slopes[name].transpose(0, 2, 1))
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
