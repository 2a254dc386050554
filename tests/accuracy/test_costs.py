"""What ``accuracy`` costs is told: CPU seconds of choosing and certifying, and progress while they go on."""

from __future__ import annotations

import io
import json
import time
from pathlib import Path

import pytest
from rich.console import Console

import rigidsim
from rigidsim.cli.screens import summary as report
from rigidsim.session.session import Observer

FREE = """name = "free"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.3, 1.0, 0.5]
[time]
end = 300
samples = 50
[output]
timeline = false
"""


def scene(*more: str) -> rigidsim.Experiment:
    return rigidsim.parse(FREE, overrides=['integrator.method="taylor"', *more])


def burn(seconds: float) -> None:
    """CPU, not waiting."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


class Slow(Observer):
    """Burns CPU while settings are chosen and while the run is certified; notes what it is told."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.told: list[str] = []

    def choosing(self, name: str) -> None:
        self.told.append(f"choosing {name}")
        burn(self.seconds)

    def phase(self, name: str) -> None:
        self.told.append(name)
        if name == "certify":
            burn(self.seconds)

    def trying(self, title: str, fraction: float) -> None:
        assert 0 <= fraction <= 1
        self.told.append(f"{title}: {fraction:.0%}")


def test_choosing_and_certifying_are_in_the_cpu_seconds(tmp_path: Path) -> None:
    slow, of = Slow(0.2), scene("integrator.accuracy=1e-9")
    began = time.process_time()
    run = rigidsim.run(of, out=tmp_path, observer=slow)
    everything = time.process_time() - began
    cost = json.loads(run.folder.summary.read_text())["cost"]
    by_phase = cost["cpu_by_phase"]
    assert list(by_phase) == ["choose", "build", "integrate_and_record", "estimate", "dataset", "certify"]
    assert set(by_phase) == set(cost["seconds"]) - {"engine"}
    assert min(by_phase["choose"], by_phase["certify"]) > 0.2
    # what is neither: reading the clocks, and writing the summary twice
    assert sum(by_phase.values()) == pytest.approx(cost["cpu_seconds"], abs=0.1)
    assert cost["cpu_seconds"] == pytest.approx(everything, abs=0.1)
    assert cost["wall_seconds"] > 0.4
    assert slow.told[0] == "choosing free"
    assert any(told.startswith("double") for told in slow.told[1 : slow.told.index("integrate")])
    assert any(told.startswith("extended") for told in slow.told[slow.told.index("certify") :])
    out = io.StringIO()
    report.print_summary(run.outcome, "runs/free", Console(file=out, width=200))
    (line,) = [line for line in out.getvalue().splitlines() if line.startswith("CPU")]
    for phase in ("choose ", "build ", "integrate and record ", "dataset ", "certify "):
        assert phase in line
