"""What loads of unknown size add to a motion is estimated well enough for its units and drift scales."""

from __future__ import annotations

import math
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from equations import prepared
from support import run_text

import rigidsim
from rigidsim.model.loads import LoadModel

BODY = "principal_moments = [1, 1.5, 2]"
REST, SPIN = "angular_velocity = [0, 0, 0]", "angular_velocity = [0, 0, 1]"


def gained(torque: str, *, end: float = 100.0, initial: str = REST, frame: str = "body") -> float:
    load = f'kind = "torque"\nframe = "{frame}"\ncomponents = [0, 0, "{torque}"]'
    drive = prepared(BODY, initial, load, end=end).system.scaling.drive
    assert drive is not None
    return float(drive.energy)


@pytest.mark.parametrize("frame", ["space"])
@pytest.mark.parametrize(
    ("torque", "impulse"),
    [
        ("1", 100.0), ("1e-12", 1e-10), ("sin(t)^2", 50.0), ("exp(-t/10)", 10.0),
        ("tanh((t-50)/0.001)", 50.0), ("exp(-((t-50)/1e-4)^2)", 1e-4 * math.sqrt(math.pi)),
        ("exp(-1e8*(t-50)^2)", 1e-4 * math.sqrt(math.pi)),
        ("exp(-((t-50)/1e-9)^2)", 1e-9 * math.sqrt(math.pi)), ("t", 5000.0),
    ],
)  # fmt: skip
def test_a_push_that_adds_up(torque: str, impulse: float, frame: str) -> None:
    """From rest about z the energy is J^2 / 2 I; a scale needs a factor of a few, not digits."""
    assert impulse**2 / 4 / 2 < gained(torque, frame=frame) < 8 * impulse**2 / 4


@pytest.mark.parametrize("size", ["1e-9", "1", "1e9"])
def test_a_body_at_rest_is_measured_by_what_drives_it(size: str) -> None:
    """Whatever the size of the torque: the same relative drifts, and no warning without a cause."""
    text = f"""name = "driven"
[body]
principal_moments = [1, 1.5, 2]
[initial]
angular_velocity = [0, 0, 0]
[[loads]]
kind = "torque"
components = ["{size}*sin(t)", "{size}*cos(t)^2", "{size}*exp(-t)"]
[time]
end = 10
[output]
record = ["angular_velocity"]
[limits]
max_steps = 1000000
"""
    if size == "1e9":
        text = text.replace("end = 10", "end = 1e-3")
    run = run_text(text)
    row = run.summary["invariants"]["energy_balance"]
    assert "at rest" not in row["scale_name"]
    assert 0 < row["largest_drift"] <= row["bound"]
    assert not [w for w in run.summary["warnings"] if "energy_balance" in w]
    energy = float(np.abs(run.dataset["energy_balance_drift"].attrs["scale"]))
    assert energy > 0


class Thruster(LoadModel):
    title = "thruster"

    def torque(self, m: Any) -> list[Any]:
        size = m.scene.context.ldexp(m.scene.context.mpf(3), -m.scaling.energy)
        return [([0, 0, size], hy.expression(1.0))]


FREE = f"""name = "free"
[body]
{BODY}
[initial]
{REST}
[time]
end = 100
"""


def test_plan_with_loads_from_python() -> None:
    found = rigidsim.plan(rigidsim.parse(FREE), loads=[Thruster()])
    assert "work" in found.states
    assert [i.name for i in found.invariants if not i.numerical] == ["energy_balance"]
    alone = rigidsim.plan(rigidsim.parse(FREE))
    assert "work" not in alone.states
