"""Which picture a sweep gets: lines, dots, a map, or the sphere; which where none is asked for."""

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")

from rigidsim.look.figures.sweeps import drawable, sweep_figure


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
