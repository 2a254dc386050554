"""What the screen says of a sweep whose members can't share a batch."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from rigidsim.cli.app import app

CONFIG = """\
name = "box"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 1, 0.05]
[time]
end = 1
samples = 2
[integrator]
formulation = "rates"
KEYS
[output]
estimate = false
[sweep]
keep = ["final"]
axes."initial.angular_velocity[2]" = {values = [0.1, 0.2], name = "w3"}
"""


@pytest.mark.parametrize(
    ("keys", "why", "cure"),
    [
        ("hold_invariants = true", "invariants are projected between steps", "hold_invariants = false"),
        ("[limits]\nwall_time = 100", "", "[limits] wall_time is watched run by run: leave it out"),
    ],
)
def test_members_run_one_by_one_for_a_reason_and_with_a_cure(
    keys: str, why: str, cure: str, tmp_path: Path
) -> None:
    (tmp_path / "c.toml").write_text(CONFIG.replace("KEYS", keys))
    told = CliRunner().invoke(app, ["sweep", str(tmp_path / "c.toml"), "--out", str(tmp_path)])
    assert told.exit_code == 0, told.output
    said = " ".join(told.output.split())
    assert "(2 one by one)" in said
    assert why in said
    assert cure in said
