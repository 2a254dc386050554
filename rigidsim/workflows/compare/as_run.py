"""A trajectory's file as a run, without an experiment: to be viewed, plotted and analysed.

Its convention is the one in which the attitude turns at the rates that the file has. Without rates only what
names or matrices say by themselves is taken; the rest is refused, and ``compare`` finds it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rigidsim.errors import RigidsimError
from rigidsim.formats.spice import CK_SUFFIX, read_ck
from rigidsim.formats.trajectories import (
    Trajectory,
    file_and_segment,
    is_trajectory,
    read_trajectory,
    trajectory_of,
)
from rigidsim.scene.scene import Scene
from rigidsim.store.run import Run, SavedRun, ShownRun, open_run
from rigidsim.store.summary import Brief
from rigidsim.workflows.compare.conventions import (
    ANGLES,
    QUATERNION,
    Attitudes,
    Convention,
    attitude_conventions,
    attitudes_of,
    find_convention,
    rate_conventions,
)

_AXES = {"body_axis": list("xyz"), "space_axis": list("XYZ"), "quaternion_component": list("wxyz")}


def trajectory_given(table: Any, scene: Scene, kernels: Sequence[str | Path]) -> Trajectory:
    """The columns of a file, of a run or its folder, or of arrays, a DataFrame or a Dataset.

    Args:
        kernels: that a CK is read with, at times of the scene.
    """
    if isinstance(table, Run):
        with table.dataset as dataset:
            return trajectory_of(dataset, table.place)
    if not isinstance(table, str | Path):
        found = trajectory_of(table)
        return found if hasattr(table, "data_vars") else replace(found, reach=scene.reach).dated()
    path = Path(table)
    if path.suffix.lower() == CK_SUFFIX or kernels:
        if scene.epoch is None:
            raise RigidsimError(f"{path}: a CK holds dates; give the date of time 0 as [time] epoch")
        files, zero = [Path(one) for one in kernels], scene.epoch.since_j2000()
        return read_ck(path, files, zero, *scene.reach)
    if path.is_dir() and path.suffix != ".zarr":
        return trajectory_given(open_run(path), scene, kernels)
    return read_trajectory(path, scene.reach).in_axes(scene.axes)


def files_of(table: Any, kernels: Sequence[str | Path] = ()) -> list[Path]:
    """The files that ``trajectory_given`` reads."""
    read = table.files if isinstance(table, Run) else [table] if isinstance(table, str | Path) else []
    return [file_and_segment(Path(path))[0] for path in (*read, *kernels)]


def open_any(path: str | Path) -> SavedRun | ShownRun:
    """A run's folder or dataset, or another tool's file.

    Raises:
        RunFolderError: neither, or a damaged run.
        RigidsimError: the file can't be used, or its convention can't be found.
    """
    given_path, _ = file_and_segment(Path(path))
    if not is_trajectory(given_path) or not given_path.exists():
        return open_run(Path(path))
    trajectory = read_trajectory(Path(path))
    epoch = trajectory.epochs[0] if trajectory.epochs else None
    given = attitudes_of(trajectory, epoch)
    notes = list(given.notes)
    if given.time_unit is None:
        notes.append("times were taken for s; name a unit: t [day]")
    if given.rates is None and (given.kind == ANGLES or (given.kind == QUATERNION and not given.order)):
        raise RigidsimError(
            f"{path}: without angular velocities its convention can't be determined; name a quaternion "
            "qw qx qy qz, add wx wy wz, or let rigidsim compare CONFIG FILE --timeline find it"
        )
    if trajectory.settled:
        notes.append("attitude and rates were taken between the frames that the file names")
        found = attitude_conventions(given)[0]
        found = found if given.rates is None else replace(found, **rate_conventions(given)[0])
    elif given.rates is None:
        notes.append("the attitude was taken from body axes to space axes")
        found = attitude_conventions(given)[0]
    else:
        found, _ = find_convention(given, {})
        notes.append(f"taken as {found}: it turns at these")
        if found.undecided:
            others = len(found.undecided)
            notes.append(f"{others} other conventions fit as well; compare decides with an experiment")
    dated = {"epoch": str(epoch)} if epoch is not None else {}
    name = given_path.stem
    dataset = dataset_of_rows(given, found, {"title": name, "comment": "; ".join(notes), **dated})
    outcome = Brief(name=name, status="finished", message=f"is the file {given_path.name}")
    return ShownRun(given_path, outcome, dataset, tuple(notes))


def dataset_of_rows(given: Attitudes, found: Convention, attributes: Mapping[str, Any]) -> xarray.Dataset:
    """A trajectory, read in a convention, as the dataset of a run."""
    quaternions = found.quaternions(given)
    jumps = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0  # of the sign, which means nothing
    quaternions = quaternions * np.cumprod(np.concatenate([[1.0], np.where(jumps, -1.0, 1.0)]))[:, None]
    rates = None if given.rates is None else found.rates(given.rates, quaternions)
    made: dict[str, Any] = {
        name: (("time", dim), values, {"units": unit, "long_name": words})
        for name, values, dim, unit, words in (
            ("quaternion", quaternions, "quaternion_component", "1", "attitude quaternion, body to space"),
            ("angular_velocity", rates, "body_axis", "rad s-1", "angular velocity"),
            ("position", given.positions, "space_axis", "m", "position"),
            ("velocity", given.velocities, "space_axis", "m s-1", "velocity"),
        )
        if values is not None
    }
    for name, values in given.trajectory.columns.items():
        made.setdefault(name, ("time", values, {"units": given.trajectory.units.get(name, "")}))
    used = {dim for dims, *_ in made.values() for dim in np.atleast_1d(dims)}
    coordinates: dict[str, Any] = {"time": ("time", given.times, {"units": "s", "long_name": "time"})}
    coordinates |= {dim: labels for dim, labels in _AXES.items() if dim in used}
    source = f"a file of another tool: {given.trajectory.source}"
    return xarray.Dataset(made, coordinates, {"source": source, **attributes})
