"""The command ``sweep``, and the sweeps of ``run --sweep``."""

import shlex
import time
from collections.abc import Sequence
from pathlib import Path

import rigidsim.workflows.sweeps.sweep as workflow
from rigidsim.cli.exits import refuse_options
from rigidsim.cli.screens.page import Page, Styled, answer
from rigidsim.errors import RigidsimError
from rigidsim.scene.config import Experiment
from rigidsim.scene.sweep import Sweep, scanned
from rigidsim.session.progress import Meter, left_text, meter
from rigidsim.store.sweeps.saved import FittedOfMembers, SavedSweep
from rigidsim.workflows.fit.fitting import digits_text
from rigidsim.workflows.read import load
from rigidsim.workflows.sweeps.sweep import SweepObserver


def sweep(
    config: Path, out: Path, overrides: list[str] | None, workers: int | None, scheduler: str | None,
    tiles: str | None, force: bool, as_json: bool,
) -> int:  # fmt: skip
    """Run all members, or a share of them."""
    share = None if tiles is None else _share(tiles)
    if scheduler is not None:
        refuse_options("is for processes of this machine, and --scheduler has its own", workers=workers)
    experiment = load(config, overrides=overrides or [])
    with meter() as shown:
        result = workflow.sweep(
            experiment, out=out, force=force, workers=workers or 1, scheduler=scheduler, tiles=share,
            observer=SweepProgress(shown),
        )  # fmt: skip
    code = ended(result, as_json)
    return 0 if result.finished or share is not None else code


def run_scanned(
    experiments: Sequence[Experiment], scan: list[str], out: Path, *, force: bool, as_json: bool
) -> int:
    """Sweep each config over the axes of ``run --sweep``."""
    worst = 0
    for experiment in experiments:
        with meter() as shown:
            motion = experiment if experiment.config.fit is None else experiment.with_overrides(["fit="])
            result = workflow.sweep(
                scanned(motion, scan), out=out, force=force, observer=SweepProgress(shown)
            )
        worst = worst or ended(result, as_json)
    return worst


def ended(result: SavedSweep, as_json: bool) -> int:
    """Print a sweep; returns its exit code."""
    answer(as_json, result.summary, print_sweep, result)
    return int(result.summary.get("exit_code", 0))


def _share(text: str) -> tuple[int, int]:
    first, colon, stop = text.partition(":")
    if not (colon and first.isdigit() and stop.isdigit() and int(first) < int(stop)):
        raise RigidsimError(
            f"--tiles: given {text!a}; two whole numbers A:B are allowed, A below B, counted from 0, such as "
            "0:25 (rigidsim plan says how many tiles there are)"
        )
    return int(first), int(stop)


# --- output -------------------------------------------------------------------------------------------------


class SweepProgress(SweepObserver):
    """Shows a sweep on a meter."""

    def __init__(self, meter: Meter) -> None:
        self._meter = meter

    def checking(self, sweep: Sweep) -> None:
        self._meter.name = sweep.experiment.config.name
        self._meter.phase(f"{sweep.count:,} members: checking their configs")

    def started(self, folder: Path, members: int, done: int) -> None:
        self._members, self._before, self._begin = members, done, time.perf_counter()
        there = f", {done:,} are there already" if done else ""
        self._meter.phase(f"running {members:,} members into {folder}{there}")

    def progressed(self, done: int) -> None:
        elapsed, new = max(time.perf_counter() - self._begin, 1e-9), done - self._before
        left = left_text(elapsed, new / max(self._members - self._before, 1))
        said = f"{done:,} of {self._members:,} members, {new / elapsed:.3g} a second, {left}"
        self._meter.update(done / max(self._members, 1), said)

    def completing(self) -> None:
        self._meter.phase("writing dataset.h5")

    def nothing_left(self) -> None:
        self._meter.note(f"{self._meter.name}: nothing is left to do: all members were run before")


_INTEGRATED = "momentum's direction (attitude in full models), of its integration alone"
_ERRORS = {
    "modelling": "axes of averaged models from the full model's",
    "modelling_norm": "size of the angular momentum in averaged models, relative",
    "modelling_energy": "energy of rotation in averaged models, relative",
}


def print_sweep(result: SavedSweep) -> None:
    """Print how a sweep's members ended."""
    outcome, on = result.outcome, Page()
    on.say((outcome.name, "bold"), f" ({result.place}): {outcome.message}")
    place = shlex.quote(result.place)
    if not result.finished:
        if outcome.tiles is not None:
            on.line("blocks", f"{outcome.tiles_done:,} of {outcome.tiles:,}")
        if result.status == "interrupted":
            on.line("next", f"rigidsim resume {place}")
        return
    on.line("axes", " x ".join(f"{name} {size:,}" for name, size in outcome.shape.items()))
    ended = [[status, f"{number:,}"] for status, number in outcome.outcomes.items()]
    on.table(["ended", "members"], ended, ruled=False)
    cost = outcome.cost
    assert cost is not None
    engines = ", ".join(f"{n:,} {_ENGINES.get(engine, engine)}" for engine, n in outcome.engines.items())
    errors = f", {cost.estimate_cpu_seconds:.3g} s of them for errors" if cost.estimate_cpu_seconds else ""
    steps = "" if _FITS in outcome.engines else f"{cost.steps:,} steps, "
    spent = f"{steps}{cost.cpu_seconds:.3g} s of CPU in {cost.tiles:,} blocks of members"
    on.line("cost", f"{spent} ({engines}){errors}")
    if outcome.fitted:
        on.table(
            ["parameter", "median", "spread", "sigma", ""], [_fitted(*row) for row in outcome.fitted.items()]
        )
    if outcome.why_alone is not None and outcome.engines.get("alone"):
        on.line("", _one_by_one(outcome.why_alone))
    for name, error in outcome.estimated_errors.items():
        averaged = name == "attitude" and "modelling" in outcome.estimated_errors
        words = _INTEGRATED if averaged else _ERRORS.get(name, name)
        units = "" if error.units == "1" else f" {error.units}"
        sizes = f"{error.median:.2g}{units} in the median, at most {error.largest:.2g}"
        on.line("error", f"{words}: {sizes}, estimated of {error.members:,} members")
    for name, drift in outcome.largest_drifts.items():
        on.line("drift", f"{name.removesuffix('_drift')}: at most {drift:.2g}")
    on.lines("warning", outcome.warnings, "yellow")
    on.line("next", f"rigidsim plot {place}")
    if _FITS not in outcome.engines:
        on.line("", f"rigidsim view {place} --member 0")
    on.line("", f"rigidsim export {place} --format csv")


def _fitted(key: str, one: FittedOfMembers) -> list[Styled]:
    """What fits found of one parameter: between members, and by their own sigmas."""
    sigma = "undetermined" if one.sigma is None else f"{one.sigma:.2g}"
    unit = "" if one.unit == "1" else one.unit
    return [key, digits_text(one.median, one.sigma or 0.0), f"{one.spread:.2g}", sigma, unit]


_FITS = "fits"
_ENGINES = {"alone": "one by one"}
_CURES = {
    "asked": "[sweep] batch = false says so: leave it out, and they run four or eight at once",
    "wall_time": "[limits] wall_time is watched run by run: leave it out, and they run in batches",
    "frequencies": "frequencies need whole runs: keep something else, or take fewer members",
    "precision": 'precision = "double" runs in batches',
    "closed_form": 'method = "taylor" runs in batches',
    "held": "hold_invariants = false runs in batches",
    "accuracy": "give a tolerance in place of accuracy, and they run in batches",
    "chart": 'formulation = "quaternion" runs in batches',
    "angles": "record quaternion in place of those angles, and they run in batches",
    "key": "members that differ in a number of the body, the start or a load run in batches",
    "families": "sweep a number of the body, the start or a load, or take more members of each kind",
}
"""What to do about it, by the code of why members run one by one."""


def _one_by_one(code: str) -> str:
    """Why members were run one by one, and the cure where there is one."""
    from rigidsim.solve.batch.family import NotBatchable

    known = {one.name.lower(): one.value for one in NotBatchable}
    cure = _CURES.get(code, "")
    said = [words for words in (known.get(code, ""), cure) if words]
    return "one by one, several times as slow as in batches: " + ("; ".join(said) or code)
