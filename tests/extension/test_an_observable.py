"""Observables from outside the package: one entry each, recorded by name; one that is conserved is watched.

Everything above the tests is what their author writes.
"""

from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np
from support import config, run_text

import rigidsim
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables import Observable, only_when_named
from rigidsim.scene.registry import register_observable


def spin_parameter(m: Mechanics) -> list[Any]:
    """w_x^2 + w_y^2 over the square of the unit of rates: a quantity that nobody else records."""
    return [m.rates[0] ** 2.0 + m.rates[1] ** 2.0]


TRANSVERSE = Observable(
    "transverse_rate_squared", (), "rad2 s-2", "square of the rate across the body's z axis",
    spin_parameter, lambda m: [-2 * m.scaling.time], "body axes", by_default=only_when_named,
)  # fmt: skip


def free_of_torque(m: Mechanics) -> str | None:
    return None if m.torque else "no torque acts"


def ratio_scale(m: Mechanics) -> tuple[Any, str]:
    return m.scene.context.one, "1 kg m^2"


RATIO = Observable(
    "momentum_squared_over_energy", (), "kg m2", "squared angular momentum over twice the energy",
    lambda m: [hy.sum([x * x for x in m.momentum_body]) / (2.0 * m.rotational_energy)],
    lambda m: [m.scaling.inertia], conserved=free_of_torque, drift_scale=ratio_scale,
    by_default=only_when_named,
)  # fmt: skip


def register() -> None:
    register_observable(TRANSVERSE)
    register_observable(RATIO)


# --- the tests ----------------------------------------------------------------------------------------------


def test_an_observable_is_recorded_by_its_name() -> None:
    assert "transverse_rate_squared" not in run_text(config()).dataset  # only where it is named
    named = config(output='record = ["angular_velocity", "transverse_rate_squared"]')
    dataset = run_text(named).dataset
    found = dataset["transverse_rate_squared"]
    assert found.attrs["units"] == "rad2 s-2"
    assert found.attrs["long_name"] == "square of the rate across the body's z axis"
    assert found.dims == ("time",)
    rates = dataset["angular_velocity"].values
    # two products, a sum and the rounding of the recorded rates
    np.testing.assert_allclose(found.values, rates[:, 0] ** 2 + rates[:, 1] ** 2, rtol=8 * 2.0**-53)


RECORDED = config(
    output='record = ["quaternion", "transverse_rate_squared", "momentum_squared_over_energy"]',
    time="end = 6\nsamples = 25",
    estimate=True,
)


def test_one_that_is_conserved_is_watched_and_reproduced(tmp_path: Path) -> None:
    """By hand: sum (I w)^2 / sum I w^2 of the rates at the start."""
    run = rigidsim.run(rigidsim.parse(RECORDED), out=tmp_path)
    row = run.summary["invariants"]["momentum_squared_over_energy"]
    assert 0 <= row["largest_drift"] <= row["bound"]
    moments, rates = np.array([1, 2, 2.5]), np.array([0.3, 1.0, 0.5])
    expected = (moments * rates) @ (moments * rates) / (moments * rates @ rates)
    found = run.dataset["momentum_squared_over_energy"].values
    np.testing.assert_allclose(found, expected, rtol=row["bound"])
    assert rigidsim.verify(run.folder.path).identical
