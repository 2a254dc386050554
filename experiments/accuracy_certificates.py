"""Does ``accuracy`` keep its word? True errors of random scenes, compared with their certificates.

Method: random scenes of every kind (``experiments.random_scenes``) run with the accuracy that they ask for.
The truth is another run of the scene at the same samples: quadruple precision, or 60 digits where the
accuracy or the certificate's own reference needs more; of long scenes with a closed form, that in 70 digits.

Expected: no true error exceeds its certificate, and no certified run misses the accuracy asked for.

Run: python -m experiments.accuracy_certificates [--full] [--out DIR] [--first N --count M] [--seed S]
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

import rigidsim
from experiments import common
from experiments.common import Check
from experiments.random_scenes import KINDS, RandomScene, random_scene
from rigidsim.accuracy.comparison import angles_between, parts_of
from rigidsim.errors import ConfigError

NAME = "accuracy_certificates"
_LONG = 2000.0  # rad: beyond, the truth is the closed form
_TIGHT = 1e-15  # rad: below, quadruple precision is no truth


@dataclass(frozen=True)
class Outcome:
    """What became of one scene: the errors asked for, certified and true (rad; nan without a run)."""

    scene: RandomScene
    certified: float = math.nan
    true: float = math.nan
    stopped: str = ""

    @property
    def kept(self) -> bool:
        """Whether the run was certified within the accuracy asked for."""
        return self.certified <= self.scene.accuracy

    @property
    def violated(self) -> bool:
        """Whether the true error exceeds the certificate."""
        return not self.stopped and not self.true <= self.certified

    @property
    def line(self) -> str:
        """For the terminal."""
        head = f"{self.scene.number:4} {self.scene.kind:20} asked {self.scene.accuracy:.1e}"
        if self.stopped:
            return f"{head}  {self.stopped}"
        verdict = "  VIOLATION" if self.violated else "" if self.kept else "  not kept"
        return f"{head}  certified {self.certified:.1e}  true {self.true:.1e}{verdict}"


def examine(scene: RandomScene) -> Outcome:
    """Run a scene, and compare its certificate with the truth."""
    experiment = rigidsim.parse(scene.text, overrides=["output.timeline=false"])
    try:
        run = rigidsim.run(experiment, out=None)
    except ConfigError as error:
        return Outcome(scene, stopped=f"refused: {error}")
    if run.status != "finished":
        return Outcome(scene, stopped=f"{run.status}: {run.summary['message']}")
    accuracy = run.summary["accuracy"]
    own = run.dataset
    rows = np.unique(np.linspace(0, own.sizes["time"] - 1, min(own.sizes["time"], 400)).astype(int))
    truth = rigidsim.run(_truth(scene, str(accuracy["how"])), out=None).dataset
    true = angles_between(parts_of(own, "quaternion", rows), parts_of(truth, "quaternion", rows))
    certified = accuracy.get("certified")
    return Outcome(scene, math.inf if certified is None else certified, float(true.max()))


def _truth(scene: RandomScene, compared_with: str) -> rigidsim.Experiment:
    """The scene in another precision or method than its certificate was compared with."""
    closed = "closed form" in compared_with
    integrator: dict[str, object] = {"precision": 60, "formulation": "quaternion"}
    if closed and scene.radians > _LONG:
        integrator = {"precision": 70, "method": "closed_form"}
    elif scene.accuracy >= _TIGHT and "quadruple" not in compared_with:
        integrator |= {"precision": "quadruple", "tolerance": 1e-26}
    else:
        integrator |= {"tolerance": min(1e-30, scene.accuracy * 1e-12)}
    given = rigidsim.parse(scene.text, overrides=["output.timeline=false", "output.estimate=false"])
    return given.replace(integrator=integrator)


def campaign(numbers: Iterable[int], seed: int = 0) -> list[Outcome]:
    """Examine scenes in turn, and print a line for each."""
    outcomes = []
    for number in numbers:
        outcomes.append(examine(random_scene(number, seed)))
        print(outcomes[-1].line, flush=True)
    return outcomes


def checks(outcomes: Sequence[Outcome]) -> list[Check]:
    """What is promised, compared with what was found."""
    run = [o for o in outcomes if not o.stopped]
    beyond = sum(o.violated for o in run)
    missed = sum(o.kept and not o.true <= o.scene.accuracy for o in run)
    kept = sum(o.kept for o in run) / len(run) if run else math.nan
    broken = sum(bool(o.stopped) and not o.stopped.startswith("refused") for o in outcomes)
    source = "more digits than the certificate's reference"
    return [
        Check("scenes whose true error exceeds the certificate", beyond, 0, 0.0, "1", source, "absolute"),
        Check("certified scenes that miss the accuracy", missed, 0, 0.0, "1", source, "absolute"),
        Check("scenes that broke", broken, 0, 0.0, "1", "none may", "absolute"),
        Check("share of runs certified within the accuracy", kept, 1.0, 0.02, "1", "every run", "absolute"),
    ]


def _figure(outcomes: Sequence[Outcome], out: Path) -> None:
    run = [o for o in outcomes if not o.stopped]
    asked, certified, true = (
        np.array(x) for x in zip(*((o.scene.accuracy, o.certified, o.true) for o in run), strict=True)
    )
    axes = (figure := common.new_figure(8, 5.2, "An accuracy asked for is kept and certified")).subplots()
    ends = np.array([asked.min() / 3, asked.max() * 3])
    axes.loglog(ends, ends, color=common.GREY, linewidth=1, label="accuracy asked for")
    axes.vlines(asked, np.maximum(true, 1e-40), certified, color="#cccccc", linewidth=0.8)
    axes.loglog(asked, certified, "v", color=common.ORANGE, markersize=4, label="certified")
    axes.loglog(asked, true, "o", color=common.BLUE, markersize=3, label="true")
    common.tidy(
        axes, "attitude error asked for, rad", "attitude error, rad", "true <= certified <= asked for"
    )
    axes.legend(frameon=False, loc="upper left")
    common.save(figure, out, NAME)


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog=f"python -m experiments.{NAME}")
    common.add_arguments(parser)
    parser.add_argument("--first", type=int, default=0, metavar="N", help="number of the first scene")
    parser.add_argument("--count", type=int, metavar="M", help="how many scenes")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args(argv)
    count = arguments.count or (300 if arguments.full else 2 * len(KINDS))
    outcomes = campaign(range(arguments.first, arguments.first + count), arguments.seed)
    _figure(outcomes, arguments.out)
    found = checks(outcomes)
    print(common.table(found, NAME))
    print(f"figure: {arguments.out / NAME}.png")
    return int(not all(check.passed for check in found))


if __name__ == "__main__":
    raise SystemExit(main())
