"""One scene: its certificate held against the truth, and its cost against a full search."""

from __future__ import annotations

import math
import tempfile
import time
from dataclasses import dataclass, replace

import mpmath
import numpy as np

import rigidsim
from experiments.certificates.searching import Search, truth_setting
from experiments.random_scenes import RandomScene
from rigidsim.accuracy.comparison import angles_between, exact_times, parts_of
from rigidsim.accuracy.motion import motion_of
from rigidsim.accuracy.reference import references
from rigidsim.accuracy.setting import Setting, cost, setting_of
from rigidsim.accuracy.trial import try_setting
from rigidsim.errors import ConfigError
from rigidsim.scene.config import Experiment, parse
from rigidsim.scene.scene import build_scene

_MOST_ROWS = 400
_WIDE_ROWS = 128  # where the truth is a closed form: milliseconds each


@dataclass(frozen=True)
class Outcome:
    """What became of one scene.

    Attributes:
        number, kind, radians: of the scene.
        asked: accuracy asked for, rad.
        chosen: title of the setting.
        refused: the message, where the run was refused before it began.
        broken: what went wrong, where the run didn't finish.
        certified, true: rad; nan where there was no run.
        ratio: counted cost over that of the cheapest setting of all; nan where nothing keeps the accuracy.
        cheapest: title of that.
        how: what the certificate compared with.
        choose_seconds, certify_seconds, run_seconds: CPU of the choice, of the certificate, and of the whole
            run with both.
        cpu_seconds: of examining the scene, truth and search included.
    """

    number: int
    kind: str
    radians: float
    asked: float
    chosen: str = ""
    refused: str = ""
    broken: str = ""
    certified: float = math.nan
    true: float = math.nan
    ratio: float = math.nan
    cheapest: str = ""
    how: str = ""
    choose_seconds: float = math.nan
    certify_seconds: float = math.nan
    run_seconds: float = math.nan
    cpu_seconds: float = math.nan

    @property
    def ran(self) -> bool:
        """Whether there is a run to judge."""
        return not self.refused and not self.broken

    @property
    def kept(self) -> bool:
        """Whether the run was certified within the accuracy asked for."""
        return self.certified <= self.asked

    @property
    def violated(self) -> bool:
        """Whether the true error exceeds the certificate, or an accuracy certified as kept."""
        return self.ran and (not self.true <= self.certified or (self.kept and not self.true <= self.asked))

    @property
    def line(self) -> str:
        """For the terminal."""
        head = f"{self.number:4} {self.kind:20} {self.radians:6.0f} rad  asked {self.asked:.1e}"
        tail = f"  {self.cpu_seconds:.1f} s"
        if self.broken:
            return f"{head}  BROKEN: {self.broken}{tail}"
        if self.refused:
            wrong = f"  WRONGLY, {self.cheapest} keeps it" if self.cheapest else ""
            return f"{head}  refused{wrong}{tail}"
        verdict = "  VIOLATION" if self.violated else "" if self.kept else "  not kept"
        return (
            f"{head}  certified {self.certified:.1e}  true {self.true:.1e}  cost x{self.ratio:.2f}  "
            f"{self.chosen} (cheapest: {self.cheapest}){tail}{verdict}"
        )


def examine(scene: RandomScene) -> Outcome:
    """Run a scene with its accuracy, hold the certificate against the truth, and search for less cost."""
    started = time.process_time()
    outcome = Outcome(scene.number, scene.kind, scene.radians, scene.accuracy)
    experiment = rigidsim.parse(scene.text)
    with tempfile.TemporaryDirectory() as folder:
        try:
            run = rigidsim.run(experiment, out=folder)
        except ConfigError as error:
            outcome = _refused(scene, experiment, replace(outcome, refused=str(error)))
        else:
            outcome = _judged(scene, experiment, run, outcome)
    return replace(outcome, cpu_seconds=time.process_time() - started)


def _judged(scene: RandomScene, experiment: Experiment, run: rigidsim.Run, outcome: Outcome) -> Outcome:
    """A run's certificate and cost; the truth is worked out once, for both."""
    summary = run.summary
    if run.status != "finished":
        return replace(outcome, broken=f"{run.status}: {summary['message']}")
    accuracy, spent = summary["accuracy"], summary["cost"]
    with run.dataset as dataset:
        samples = dataset.sizes["time"]
        setting = setting_of(parse(dataset.attrs["config"], source=outcome.kind))
        kinds = {r.how: r.kind for r in references(setting, motion_of(experiment), scene.accuracy)}
        reference = truth_setting(experiment, setting, scene, kinds.get(accuracy["how"]))
        most = _MOST_ROWS if reference.has_steps else _WIDE_ROWS
        rows = np.unique(np.linspace(0, samples - 1, min(samples, most)).astype(int))
        times = exact_times(dataset, rows)
        attitudes = parts_of(dataset, "quaternion", rows)
    truth = try_setting(experiment, reference, times, compact=True)
    true = float(angles_between(attitudes, truth.attitudes).max())
    own = cost(setting, spent["steps"], samples)
    below = own if true <= scene.accuracy else math.inf
    search = Search(experiment, scene.accuracy, times, truth, steps=spent["steps"], below=below)
    found = search.run(samples)
    certified = accuracy.get("certified")
    phases = spent["cpu_by_phase"]
    return replace(
        outcome,
        chosen=setting.title,
        certified=math.inf if certified is None else certified,
        true=true,
        ratio=own / search.cost if math.isfinite(search.cost) else math.nan,
        cheapest="" if not math.isfinite(search.cost) else (found.setting if found else setting).title,
        how=str(accuracy["how"]),
        choose_seconds=phases["choose"],
        certify_seconds=phases["certify"],
        run_seconds=spent["cpu_seconds"],
    )


def _refused(scene: RandomScene, experiment: Experiment, outcome: Outcome) -> Outcome:
    """Right if nothing in the full search keeps the accuracy; such a setting is named where there is one."""
    last = float(build_scene(experiment).samples.last)
    times = [mpmath.mpf(float(x)) for x in np.linspace(0, last, 101)[1:]]
    truth = try_setting(experiment, truth_setting(experiment, Setting(), scene), times, compact=True)
    found = Search(experiment, scene.accuracy, times, truth).run(len(times))
    return replace(outcome, cheapest="" if found is None else found.setting.title)
