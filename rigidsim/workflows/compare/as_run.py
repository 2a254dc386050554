"""A trajectory's file as a run, without an experiment beside it: to be viewed, plotted and analysed.

Its convention is the one in which the attitude turns at the rates that the file has. Without rates only what
names or matrices say by themselves is taken; the rest is refused, and ``compare`` finds it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import xarray

from rigidsim.errors import RigidsimError
from rigidsim.formats.trajectories import Trajectory, is_trajectory, read_trajectory, trajectory_of
from rigidsim.store.run import Run, SavedRun, open_run
from rigidsim.store.summary import Brief
from rigidsim.workflows.compare.columns import Attitudes, attitudes_of, seconds_in
from rigidsim.workflows.compare.conventions import (
    BODY_TO_SPACE,
    NONE,
    FoundReading,
    RateReading,
    Reading,
    possible_rates,
    readings,
    rows_compared,
)  # fmt: skip
from rigidsim.workflows.compare.rotations import conjugated, multiplied, vector_of

_LEAST, _ALIKE = 1e-9, 0.35  # as of conventions, for mean logarithms of rates
_POOR = np.log(0.3)  # mean logarithm of the rates' mismatch, relative, above which no reading is right
_FASTEST = 2.0  # rad from row to row, above which turns are no rates
_AXES = {"body_axis": list("xyz"), "space_axis": list("XYZ"), "quaternion_component": list("wxyz")}


@dataclass(frozen=True, repr=False)
class TrajectoryRun(Run):
    """A trajectory of another tool, shown as a run is."""

    path: Path
    outcome: Brief

    @property
    def place(self) -> str:
        """The file."""
        return str(self.path)

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """Attitude, rates and flight, in s, rad/s and SI, and all other columns as they are."""
        return run_dataset(self.path)

    @property
    def notes(self) -> list[str]:
        """What a user should know of how it was read."""
        return str(self.dataset.attrs["comment"]).split("; ")

    def concluded(self, outcome: Brief) -> Self:
        """Nothing is saved of it."""
        return self

    def beside(self, name: str) -> Path:
        """Where something that is made of it goes if nothing else is asked for."""
        return self.path.with_name(f"{self.path.stem}_{name}")


def trajectory_given(table: Any) -> Trajectory:
    """The columns of a file, of a run or its folder, or of arrays, a DataFrame or a Dataset."""
    if isinstance(table, Run):
        with table.dataset as dataset:
            return trajectory_of(dataset, table.place)
    if not isinstance(table, str | Path):
        return trajectory_of(table)
    path = Path(table)
    return (
        trajectory_given(open_run(path))
        if path.is_dir() and path.suffix != ".zarr"
        else read_trajectory(path)
    )


def open_any(path: str | Path) -> SavedRun | TrajectoryRun:
    """A run's folder or dataset, or another tool's file.

    Raises:
        RunFolderError: neither, or a damaged run. RigidsimError: the file can't be read.
    """
    given = Path(path)
    if not is_trajectory(given):
        return open_run(given)
    outcome = Brief(name=given.stem, status="finished", message=f"is the file {given.name}")
    return TrajectoryRun(given, outcome)


def run_dataset(path: Path) -> xarray.Dataset:
    """The dataset of a trajectory's file.

    Raises:
        RigidsimError: the file can't be used, or its convention can't be told.
    """
    given = attitudes_of(read_trajectory(path), None)
    times = given.times * seconds_in(given.time_unit or "s")
    reading, rates, told = _read(given, times)
    found = FoundReading(reading, NONE, 0.0, [])
    return dataset_of_rows(given, times, found, rates, {"title": path.stem, "comment": "; ".join(told)})


def dataset_of_rows(
    given: Attitudes, times: np.ndarray, found: FoundReading, rates: RateReading | None,
    attributes: Mapping[str, Any],
) -> xarray.Dataset:  # fmt: skip
    """A trajectory, read in a convention, as the dataset of a run.

    Args:
        times: (rows,), s; earlier rows than the file's are left out where they are fewer.
    """
    count = len(times)
    quaternions = found.quaternions(given)[:count]
    jumps = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0  # of the sign, which means nothing
    quaternions = quaternions * np.cumprod(np.concatenate([[1.0], np.where(jumps, -1.0, 1.0)]))[:, None]
    made: dict[str, Any] = {
        "quaternion": _variable(
            quaternions, "quaternion_component", "1", "attitude quaternion, body to space"
        )
    }
    if rates is not None and given.rates is not None:
        turning = rates.rates(given.rates[:count], found, quaternions)
        made["angular_velocity"] = _variable(turning, "body_axis", "rad s-1", "angular velocity")
    for name, values, unit in (("position", given.positions, "m"), ("velocity", given.velocities, "m s-1")):
        if values is not None:
            made[name] = _variable(values[:count], "space_axis", unit, name)
    for name, values in given.trajectory.columns.items():
        if name not in made:
            made[name] = ("time", values[:count], {"units": given.trajectory.units.get(name, "")})
    used = {dim for dims, *_ in made.values() for dim in np.atleast_1d(dims)}
    coordinates: dict[str, Any] = {"time": ("time", times, {"units": "s", "long_name": "time"})}
    coordinates |= {dim: labels for dim, labels in _AXES.items() if dim in used}
    source = f"a file of another tool: {given.trajectory.source}"
    return xarray.Dataset(made, coordinates, {"source": source, **attributes})


def _variable(values: np.ndarray, dim: str, unit: str, name: str) -> Any:
    return ("time", dim), values, {"units": unit, "long_name": name}


def _read(given: Attitudes, times: np.ndarray) -> tuple[Reading, RateReading | None, list[str]]:
    """Readings of attitude and rates, and what a user should know of them."""
    source, told = given.trajectory.source, list(given.told)
    if given.time_unit is None:
        told.append("times were taken for s; name a unit: t [day]")
    if given.rates is None:
        if given.angles is not None or not (given.named or given.matrices is not None):
            raise RigidsimError(
                f"{source}: without angular velocities its convention can't be told; name a quaternion "
                "qw qx qy qz, add wx wy wz, or let rigidsim compare CONFIG FILE --timeline find it"
            )
        told.append("the attitude was taken from body axes to space axes")
        return Reading(order="wxyz" if given.named else ""), None, told
    rows = rows_compared(len(times) - 1)
    steps = times[rows + 1] - times[rows]
    tried = []
    for cost, reading in enumerate(readings(given)):
        found = FoundReading(reading, NONE, 0.0, [])
        before, after = reading.quaternions(given, rows), reading.quaternions(given, rows + 1)
        turns = vector_of(multiplied(conjugated(before), after))
        if reading.direction == BODY_TO_SPACE and np.median(np.linalg.norm(turns, axis=1)) > _FASTEST:
            told.append("rows are far apart: the convention was chosen by turns that may be others")
        for rates in possible_rates(given):
            mean = (
                rates.rates(given.rates[rows], found, before)
                + rates.rates(given.rates[rows + 1], found, after)
            ) / 2
            apart = (
                np.linalg.norm(turns / steps[:, None] - mean, axis=1) / np.linalg.norm(mean, axis=1).mean()
            )
            tried.append((float(np.mean(np.log(apart + _LEAST))), cost, reading, rates))
    best = min(score for score, *_ in tried)
    near = sorted((x for x in tried if x[0] <= best + _ALIKE), key=lambda x: x[1])
    _, _, reading, rates = near[0]
    told.append(f"taken as {reading}, rates along {rates.axes} axes in {rates.unit}: it turns at these")
    if len(near) > 1:
        told.append(
            f"{len(near) - 1} other conventions would fit as well, so that rigidsim compare may tell more"
        )
    if best > _POOR:
        told.append("in no convention tried does it turn at its rates: what is seen may be wrong")
    return reading, rates, told
