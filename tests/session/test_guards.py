"""Guards are exact and outcomes depend on the motion alone: not on the clock, nor on how a run is driven."""

from pathlib import Path

import numpy as np
import pytest
from support import cases, config, loaded, run_text, same_bits

import rigidsim
from rigidsim.session.session import Tuning
from rigidsim.solve.sampler import Pacing

PLAIN = "estimate = false"  # which is the larger part of such short runs
DRIVES = {
    "as measured": Pacing(),
    "one step at a time": Pacing(chunk_seconds=0.0),
    "no skips": Pacing(skipped_from=10**9),
    "skips too far": Pacing(skipped_from=2, margin=1.7, spare=0.0),
}
SCENES = {
    "free": config(time="end = 150\nsamples = 301"),
    "sparse": config(time="end = 300\nsamples = 4"),
    "projected": config(time="end = 150\nsamples = 76", integrator="hold_invariants = true"),
    "charts": config(time="end = 60\nsamples = 61", integrator='formulation = "euler_angles"'),
    "events": config(time="end = 150\nsamples = 16", more='[[events]]\nname = "a"\nexpression = "wy"'),
    "surfaces": config(
        loads='kind = "torque"\ncomponents = ["-0.05*sign(wx)", "0", "0.02*abs(wy)"]',
        time="end = 40\nsamples = 81",
    ),
    "many samples in a step": config(time="end = 4\nsamples = 4001"),
    "80 bits": config(time="end = 60\nsamples = 31", integrator='precision = "extended"'),
}


@pytest.mark.slow
@pytest.mark.parametrize("scene", cases(SCENES, ("events",)))
def test_max_steps_is_never_exceeded_and_always_used_up(scene: str, tmp_path: Path) -> None:
    """A step is a natural step of the engine, as ``cost.steps`` counts them; in sessions of so many each, the
    run has as many steps and the same bits as in one go, whichever way it takes.
    """
    whole = run_text(SCENES[scene])
    total = whole.summary["cost"]["steps"]
    for number, (drive, pacing) in enumerate(DRIVES.items()):
        most, tuning = max(1, (total - 1) // 2 - number), Tuning(pacing)
        guard = f"limits.max_steps={most}"
        run = run_text(SCENES[scene], guard, out=tmp_path / str(number), tuning=tuning)
        sessions = 1
        while run.status == "stopped: max_steps":
            assert run.summary["cost"]["steps"] == sessions * most, drive
            run, sessions = rigidsim.resume(run.folder.path, tuning=tuning), sessions + 1
        assert (run.status, run.summary["cost"]["steps"]) == ("finished", total), drive
        assert sessions >= 3
        same_bits(run, whole)


@pytest.mark.slow
def test_max_drift_ends_with_the_first_sample_past_it(tmp_path: Path) -> None:
    """Whichever way the run takes, with the same samples and steps; under another guard it goes on."""
    text = config(time="end = 300\nsamples = 601", integrator='precision = "single"', output=PLAIN)
    complete = run_text(text, out=tmp_path / "whole")
    data = loaded(complete)
    drifts = np.max([np.abs(data[f"{name}_drift"]) for name in complete.summary["invariants"]], axis=0)
    guard = float(drifts[:400].max())
    first = int(np.flatnonzero(drifts > guard)[0])
    assert 0 < first < 600
    steps = set()
    for number, drive in enumerate(["as measured", "one step at a time", "no skips"]):
        pacing = DRIVES[drive]
        run = run_text(text, f"limits.max_drift={guard!r}", tuning=Tuning(pacing), out=tmp_path / str(number))
        assert (run.status, run.summary["exit_code"]) == ("stopped: max_drift", 3)
        assert run.summary["samples"] == first + 1
        assert run.summary["time_reached"] == data.time[first]
        steps.add(run.summary["cost"]["steps"])
    assert len(steps) == 1
    again = rigidsim.resume(run.folder.path)
    assert (again.status, again.summary["samples"]) == ("stopped: max_drift", first + 1)
    done = rigidsim.resume(run.folder.path, overrides=["limits.max_drift=1"])
    same_bits(done, complete)


def test_an_event_past_the_last_sample_ends_nothing(tmp_path: Path) -> None:
    """Steps go past the last sample, which is where the run ends; prolonged, it ends at the event."""
    late = '[[events]]\nname = "late"\nexpression = "t - 10.01"\naction = "stop"'
    run = run_text(config(time="end = 10\nsamples = 11", more=late, output=PLAIN), out=tmp_path)
    assert run.summary["engine_time"] > 10.01
    assert (run.status, run.summary["events"]) == ("finished", {"late": 0})
    again = rigidsim.resume(run.folder.path, until="20")
    assert (again.status, again.summary["events"]) == ("finished: event", {"late": 1})
