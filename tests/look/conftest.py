"""Recorded runs to look at, from closed forms: no integrator is needed to test a picture."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

Rows = dict[str, np.ndarray]


@pytest.fixture
def symmetric_top() -> Callable[..., xarray.Dataset]:
    """A free symmetric top, I = (1, 1, 2) kg m^2, L = 1 kg m^2/s along Z, exact at any time.

    R = Rz(L t/A) Rx(theta) Rz(psi) with psi' = (1/C - 1/A) L cos(theta); `scale` (s) stretches
    time, `size` (m) the body.
    """

    def build(count: int = 1001, end: float = 20.0, scale: float = 1.0, size: float = 1.0) -> xarray.Dataset:
        time = np.linspace(0.0, end, count)
        tilt, first, third, momentum = 0.5, 1.0, 2.0, 1.0
        phi = momentum / first * time
        psi = (1 / third - 1 / first) * momentum * np.cos(tilt) * time
        half = [(0.5 * (phi + psi)), (0.5 * (phi - psi))]
        quaternion = np.stack(
            [
                np.cos(tilt / 2) * np.cos(half[0]),
                np.sin(tilt / 2) * np.cos(half[1]),
                np.sin(tilt / 2) * np.sin(half[1]),
                np.cos(tilt / 2) * np.sin(half[0]),
            ],
            axis=1,
        )
        in_body = momentum * np.stack(
            [np.sin(tilt) * np.sin(psi), np.sin(tilt) * np.cos(psi), np.full(count, np.cos(tilt))], axis=1
        )
        rates = in_body / np.array([first, first, third]) / scale
        return xarray.Dataset(
            {
                "angular_velocity": (("time", "body_axis"), rates, {"units": "rad/s"}),
                "quaternion": (("time", "quaternion_component"), quaternion, {"units": "1"}),
                "angular_momentum": (
                    ("time", "space_axis"),
                    np.tile([0.0, 0.0, momentum], (count, 1)),
                    {"units": "kg m^2/s"},
                ),
                "energy": ("time", np.full(count, 0.4), {"units": "J", "invariant": 1}),
                "energy_drift": ("time", 1e-16 * np.arange(count), {"units": "1", "drift_of": "energy"}),
            },
            coords={
                "time": ("time", time * scale, {"units": "s"}),
                "body_axis": list("xyz"),
                "space_axis": list("XYZ"),
                "quaternion_component": list("wxyz"),
            },
            attrs={
                "title": "Free symmetric top",
                "config": 'name = "top"\ndescription = "a free top"\n',
                "drawing": json.dumps(
                    [{"solid": "disk", "dimensions": {"radius": size}, "position": [0, 0, 0]}]
                ),
                "principal_moments": "[1, 1, 2]",
            },
        )

    return build


@pytest.fixture
def read_back() -> Callable[[Path, str], Rows]:
    """Columns of one entity of a recording along time, as numpy arrays, read from the file."""

    def read(path: Path, entity: str) -> Rows:
        from rerun.chunk import RrdReader

        parts: dict[str, list[np.ndarray]] = {}
        for chunk in RrdReader(path).stream():
            if chunk.entity_path != entity or chunk.is_static:
                continue
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                if name.startswith("rerun.controls"):
                    continue
                column = batch.column(name)
                while hasattr(column, "flatten") and str(column.type).startswith(("list", "fixed_size_list")):
                    column = column.flatten()
                values = column.to_numpy(zero_copy_only=False)
                parts.setdefault(name, []).append(values.reshape(batch.num_rows, -1))
        columns = {name: np.concatenate(values) for name, values in parts.items()}
        if columns:
            order = np.argsort(columns["step"][:, 0])
            columns = {name: values[order].squeeze(-1) if values.shape[1] == 1 else values[order]
                       for name, values in columns.items()}  # fmt: skip
        return columns

    return read
