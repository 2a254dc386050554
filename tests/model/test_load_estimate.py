"""What loads of unknown size add to a motion is estimated well enough for its units and drift scales."""

from __future__ import annotations

import math

import pytest
from equations import prepared
from support import config, run_text

BODY = "principal_moments = [1, 1.5, 2]"
REST = "angular_velocity = [0, 0, 0]"


@pytest.mark.parametrize(
    ("torque", "impulse"),
    [
        ("1e-12", 1e-10), ("sin(t)^2", 50.0), ("exp(-t/10)", 10.0), ("tanh((t-50)/0.001)", 50.0),
        ("exp(-((t-50)/1e-9)^2)", 1e-9 * math.sqrt(math.pi)), ("t", 5000.0),
    ],
)  # fmt: skip
def test_a_push_that_adds_up(torque: str, impulse: float) -> None:
    """From rest about z the energy is J^2 / 2 I; a scale needs a factor of a few, not digits."""
    load = f'kind = "torque"\nframe = "space"\ncomponents = [0, 0, "{torque}"]'
    drive = prepared(BODY, REST, load, end=100).system.scaling.drive
    assert impulse**2 / 4 / 2 < float(drive.energy) < 8 * impulse**2 / 4


@pytest.mark.parametrize("size", ["1e-9", "1", "1e9"])
def test_a_body_at_rest_is_measured_by_what_drives_it(size: str) -> None:
    """Whatever the size of the torque: the same relative drifts, and no warning without a cause."""
    load = f'kind = "torque"\ncomponents = ["{size}*sin(t)", "{size}*cos(t)^2", "{size}*exp(-t)"]'
    time, record = f"end = {'1e-3' if size == '1e9' else 10}", 'record = ["angular_velocity"]'
    run = run_text(config(BODY, REST, load, time, output=record))
    row = run.summary["invariants"]["energy_balance"]
    assert "at rest" not in row["scale_name"]
    assert 0 < row["largest_drift"] <= row["bound"]
    assert not [w for w in run.summary["warnings"] if "energy_balance" in w]
