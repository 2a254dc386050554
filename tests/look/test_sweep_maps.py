"""Which picture a sweep gets: lines, dots, a map, or the sphere; which where none is asked for."""

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")

from rigidsim.look.figures.sweeps import drawable, sweep_figure
from rigidsim.scene.readable import scaled


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
        attrs={"time_unit": unit},
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


def test_few_negative_values_leave_a_map_its_logarithmic_scale() -> None:
    rng, (rows, columns) = np.random.default_rng(1), (30, 20)
    table = np.where(rng.random((rows, columns)) < 0.5, 2.0, 200.0) * rng.uniform(0.9, 1.1, (rows, columns))
    low = rng.permutation(table.size)[:12]  # 2 %
    table.ravel()[low] = -1.0
    keys = {"rate": "initial.angular_velocity[2]", "angle": "initial.euler_angles[2]"}
    dataset = xarray.Dataset(
        {"megno": (("rate", "angle"), table), "status": (("rate", "angle"), np.zeros(table.shape, np.int8))},
        coords={
            k: (k, np.arange(float(n)), {"swept_key": keys[k]})
            for k, n in zip(keys, table.shape, strict=True)
        },
    )
    mesh = sweep_figure(dataset, "megno").axes[0].collections[0]
    assert mesh.norm(2.0) < 0.1
    assert mesh.norm(20.0) == pytest.approx(0.5, abs=0.05)  # in the middle of the decades
    assert np.ma.count_masked(mesh.get_array()) == 0  # the negative ones have the lowest colour
    dataset["megno"][:5] = -1.0  # too many
    assert sweep_figure(dataset, "megno").axes[0].collections[0].norm(0.0) > 0


@pytest.mark.parametrize(
    ("size", "time", "unit", "divisor"),
    [
        (2e-5, "day", "deg/day", np.pi / 180 / 86400),
        (7.29e-5, "yr", "deg/day", np.pi / 180 / 86400),  # 360 deg a day, and 131,800 a year
        (2.4e-7, "yr", "deg/yr", np.pi / 180 / 31557600),
        (1.0, "day", "rad/s", 1.0),
        (0.1, "s", "rad/s", 1.0),
    ],
)
def test_rates_are_in_the_configs_unit_of_time(size: float, time: str, unit: str, divisor: float) -> None:
    assert scaled(np.array([size]), "rad s-1", {"time_unit": time}) == (pytest.approx(divisor), unit)
