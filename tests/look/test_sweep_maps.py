"""Which picture a sweep gets: lines, dots, a map, or the sphere; which where none is asked for."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")

from rigidsim.look.figures.sweep_maps import drawable, sweep_figure


def swept(moments: int) -> xarray.Dataset:
    """First times of an event, ln(1/x)/moment, over 21 disturbances and so many moments."""
    push, moment = np.logspace(-6, -1, 21), np.linspace(2.5, 3.0, moments)
    first = np.log(1 / push)[:, None] / moment
    members = ("push", "moment")
    return xarray.Dataset(
        {
            "status": (members, np.zeros((21, moments), dtype=np.int8)),
            "spin_final": ((*members, "body_axis"), np.ones((21, moments, 3)), {"units": "rad/s"}),
            "flip_count": (members, np.ones((21, moments), dtype=np.int32), {"units": "1"}),
            "flip_first": (members, first, {"units": "s", "long_name": "first time of flip"}),
        },
        coords={"push": push, "moment": moment, "body_axis": list("xyz")},
        attrs={"title": "flips"},
    )


def test_the_first_time_of_an_event_comes_first_with_a_line_for_each_of_few_values() -> None:
    dataset = swept(3)
    assert drawable(dataset)[0] == "flip_first"
    (axes,) = sweep_figure(dataset).axes
    assert [line.get_label() for line in axes.get_lines()] == ["moment 2.5", "moment 2.75", "moment 3"]
    for line, values in zip(axes.get_lines(), dataset["flip_first"].values.T, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), dataset["push"].values)
        np.testing.assert_array_equal(line.get_ydata(), values)
    assert axes.get_xscale() == "log"
    assert len(sweep_figure(dataset, "spin_final[1]").axes[0].get_lines()) == 3


def members_of(**axes: np.ndarray) -> xarray.Dataset:
    """A sweep's dataset over these axes, with a number and the time of an event of each member."""
    shape = tuple(len(values) for values in axes.values())
    numbers = np.arange(1.0, 1 + np.prod(shape)).reshape(shape)
    plain = {name: (name, values) for name, values in axes.items() if values.ndim == 1}
    vectors = {f"{name}_value": ((name, f"{name}_component"), v) for name, v in axes.items() if v.ndim == 2}
    return xarray.Dataset(
        {
            "status": (tuple(axes), np.zeros(shape, dtype=int)),
            "energy_final": (tuple(axes), numbers),
            "flip_first": (tuple(axes), numbers),
        },
        coords=plain | vectors,
        attrs={"title": "a sweep", "comment": ""},
    )


def grid(count: int) -> np.ndarray:
    """Random unit vectors."""
    vectors = np.random.default_rng(1).standard_normal((count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def test_directions_are_drawn_on_the_sphere_each_with_its_value() -> None:
    vectors = 3 * grid(40)
    dataset = members_of(spin=vectors)
    axes = sweep_figure(dataset).axes[0]
    [dots] = axes.collections
    assert axes.name == "mollweide"
    assert dots.get_array().tolist() == list(range(1, 41))
    longitude, latitude = np.asarray(dots.get_offsets()).T
    back = np.stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    )
    assert pytest.approx(vectors / 3, abs=1e-12) == back.T


def secular(unit: str = "yr") -> xarray.Dataset:
    """A planet's precession and its lines over obliquities, with a constant, a noise line and a swing."""
    tilt = np.deg2rad(np.linspace(10, 30, 5))
    rate = -np.deg2rad(7.6 / 3600) / 3.15576e7 * np.cos(tilt)
    noise = 1e-16 * np.arange(5.0)
    return xarray.Dataset(
        {
            "status": ("tilt", np.zeros(5, dtype=np.int8)),
            "time_reached": ("tilt", np.full(5, 3e10), {"units": "s"}),
            "energy_final": ("tilt", np.full(5, 2.0) + noise, {"units": "J"}),
            "wobble_amplitude": (("tilt", "line"), noise[:, None], {"units": "rad"}),
            "wobble_rate": ("tilt", noise / 3e14, {"units": "rad/s", "long_name": "secular rate of wobble"}),
            "node_amplitude": (("tilt", "line"), 1e-5 * tilt[:, None], {"units": "rad"}),
            "node_rate": ("tilt", rate, {"units": "rad/s", "long_name": "secular rate of node"}),
        },
        coords={"tilt": ("tilt", tilt, {"units": "rad", "swept_key": "initial.euler_angles[1]"})},
        attrs={"config": f'[time]\nunit = "{unit}"'},
    )


def test_a_secular_rate_comes_before_constants_and_noise_in_the_units_of_the_config() -> None:
    dataset = secular()
    (axes,) = sweep_figure(dataset).axes
    assert axes.get_ylabel() == "node rate [arcsec/yr]"
    assert axes.get_xlabel().endswith("[deg]")
    (line,) = axes.get_lines()
    tilt = np.linspace(10, 30, 5)
    np.testing.assert_allclose(line.get_xdata(), tilt)
    np.testing.assert_allclose(line.get_ydata(), -7.6 * np.cos(np.deg2rad(tilt)))
    assert "energy_final" in drawable(dataset)  # still there by name
