"""Does ``accuracy`` keep its word? True errors of random scenes, compared with their certificates.

Method: random scenes of every kind (``experiments.random_scenes``) run with the accuracy that they ask for.
The truth is another run of the scene at the same samples: quadruple precision, or 60 digits where the
accuracy or the certificate's own reference needs more; of long scenes with a closed form, that in 70 digits.

Expected: no true error exceeds its certificate, and no certified run misses the accuracy asked for.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

import rigidsim
from experiments.common import Answer, Check, Curve, Panel, Picture, Study
from experiments.random_scenes import KINDS, RandomScene, random_scene
from rigidsim.accuracy.comparison import angles_between, parts_of
from rigidsim.errors import ConfigError

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


def picture(outcomes: Sequence[Outcome]) -> Picture:
    """True and certified errors over the accuracies asked for."""
    run = [(o.scene.accuracy, o.certified, o.true) for o in outcomes if not o.stopped]
    asked, certified, true = np.array(run).T
    ends = np.array([asked.min() / 3, asked.max() * 3])
    return Picture("An accuracy asked for is kept and certified", "a", [
        Panel("true <= certified <= asked for", "attitude error asked for, rad", "attitude error, rad", [
            Curve(ends, ends, "accuracy asked for", "grey"),
            Curve(asked, certified, "certified", "orange", "v", 1),
            Curve(asked, true, "true", "blue", "o", 0.8),
        ], "xy", legend="upper left"),
    ], (8, 5.2))  # fmt: skip


@Study
def certificates(full: bool, first: int = 0, count: int = 0, seed: int = 0) -> Answer:
    """Scenes from the first on; 300 of them with --full."""
    count = count or (300 if full else 2 * len(KINDS))
    outcomes = campaign(range(first, first + count), seed)
    return checks(outcomes), picture(outcomes)
