"""Guards are exact and outcomes depend on the motion alone: not on the clock, nor on how a run is driven."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support import cases, config, loaded, run_text, same_bits

import rigidsim
from rigidsim.session.session import Tuning
from rigidsim.solve.assembly import Assembly, assemble, sampler
from rigidsim.solve.evaluate import Evaluator
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import Pacing, SampleReceiver
from rigidsim.solve.solvers.taylor.ways import Ways
from rigidsim.solve.status import Status

PLAIN = "estimate = false"  # which is the larger part of such short runs
DRIVES = {
    "as measured": Pacing(),
    "one step at a time": Pacing(chunk_seconds=0.0, solver=Ways(grid_rows=0, least_block_steps=10**9)),
    "short grids": Pacing(chunk_seconds=1e-5),
    "blocks": Pacing(solver=Ways(block_steps=13, least_block_steps=1, skip_from=1e9, grid_rows=0)),
    "skips too far": Pacing(solver=Ways(skip_from=2.0, skip_margin=1.7, grid_rows=0)),
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


class Kept(SampleReceiver):
    """Everything recorded, in memory."""

    def __init__(self, evaluator: Evaluator) -> None:
        self.evaluator = evaluator
        self.blocks: list[dict[str, list[np.ndarray]]] = []

    def take(self, block: SampleBlock) -> None:
        self.blocks.append(self.evaluator.evaluate(block) | {"time": [block.times.astype(float)]})

    def all(self) -> dict[str, bytes]:
        return {
            f"{name}, part {n}": np.concatenate([block[name][n] for block in self.blocks]).tobytes()
            for name, parts in self.blocks[0].items()
            for n in range(len(parts))
        }


def made(scene: str, stride: int) -> tuple[InitialValueProblem, Callable[[], Assembly]]:
    """Assembled once, and put back to its start for each use."""
    prepared = prepare(rigidsim.parse(SCENES[scene]))
    parts = assemble(prepared, stride=stride)
    begin, fresh = parts.corrected.boundary(), parts.evaluator.continuity

    def again() -> Assembly:
        parts.corrected.back_to(begin)
        parts.evaluator.continuity = type(fresh)()
        return parts

    return prepared, again


@pytest.mark.parametrize("scene", cases(SCENES, ("charts", "events")))
def test_max_steps_is_never_exceeded_and_always_used_up(scene: str) -> None:
    """A step is a natural step of the engine, as ``cost.steps`` counts them; in sessions of so many each, the
    run has as many steps and the same bits as in one go, whichever way it takes.
    """
    prepared, again = made(scene, stride=32)
    parts = again()
    kept = Kept(parts.evaluator)
    total = sampler(prepared, parts, kept).run().steps
    reference = kept.all()
    for (drive, pacing), most in zip(DRIVES.items(), itertools.cycle([1, 7, 31, 33, 90])):
        parts, start = again(), None
        kept = Kept(parts.evaluator)
        before, status = 0, Status.MAX_STEPS
        while status is Status.MAX_STEPS:
            limit = before + most
            loop = sampler(prepared, parts, kept, start=start, pacing=pacing, most_steps=limit)
            status = loop.run().status
            start = loop.position()
            assert loop.progress.steps == min(limit, total), drive
            before = start.boundary.mark.steps
        assert status is Status.FINISHED, drive
        assert kept.all() == reference, drive


@pytest.mark.parametrize(
    "scene",
    cases(["free", "charts", "events", "surfaces", "many samples in a step"], ["many samples in a step"]),
)
def test_a_run_that_is_stopped_within_a_step_goes_on_within_it(scene: str) -> None:
    """After every look at the guards; samples of a step may be handed over over several of them."""
    prepared, again = made(scene, stride=32)
    parts = again()
    kept = Kept(parts.evaluator)
    total = sampler(prepared, parts, kept).run()
    reference = kept.all()
    parts, start = again(), None
    kept = Kept(parts.evaluator)
    pacing = Pacing(chunk_seconds=0.0, rows_waiting=64)
    sessions, status = 0, Status.INTERRUPTED
    while status is Status.INTERRUPTED:
        answers = iter([None, None, *[Status.INTERRUPTED] * 2])
        loop = sampler(prepared, parts, kept, lambda _, answers=answers: next(answers), start, pacing)
        status, start, sessions = loop.run().status, loop.position(), sessions + 1
    assert status is Status.FINISHED
    assert loop.progress.steps == total.steps
    assert sessions > 5
    assert kept.all() == reference
    if scene == "many samples in a step":
        assert sessions > 4 * total.steps  # a step of a thousand samples is interrupted many times


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
    for number, drive in enumerate(["as measured", "one step at a time", "blocks"]):
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


def test_max_drift_looks_at_the_last_sample_too(tmp_path: Path) -> None:
    """Below a rounding no run keeps it; one that is short is over before guards are looked at again."""
    closed = 'method = "closed_form"'
    text = config(time="end = 3\nsamples = 49", integrator=closed, output=PLAIN)
    data = loaded(run_text(text, out=tmp_path / "whole"))
    drift = np.abs(data["energy_drift"].values)
    largest = int(np.argmax(drift))
    just_below = float(np.nextafter(drift[largest], 0))
    last = config(time=f"end = {largest / 16}\nevery = 0.0625", integrator=closed, output=PLAIN)
    for out, given, guard in (("a", text, 1e-17), ("b", last, just_below)):
        run = run_text(given, f"limits.max_drift={guard!r}", out=tmp_path / out)
        assert (run.status, run.summary["exit_code"]) == ("stopped: max_drift", 3)
    again = rigidsim.resume(run.folder.path)
    assert again.status == "stopped: max_drift"
    assert rigidsim.resume(run.folder.path, overrides=["limits.max_drift=1"]).status == "finished"


def test_an_event_past_the_last_sample_ends_nothing(tmp_path: Path) -> None:
    """Steps go past the last sample, which is where the run ends; prolonged, it ends at the event."""
    late = '[[events]]\nname = "late"\nexpression = "t - 10.01"\naction = "stop"'
    run = run_text(config(time="end = 10\nsamples = 11", more=late, output=PLAIN), out=tmp_path)
    assert run.summary["engine_time"] > 10.01
    assert (run.status, run.summary["events"]) == ("finished", {"late": 0})
    again = rigidsim.resume(run.folder.path, until="20")
    assert (again.status, again.summary["events"]) == ("finished: event", {"late": 1})
