"""Does ``accuracy`` keep its word? True errors against certificates, and costs against a full search.

Random scenes of every kind are run with an accuracy asked for. The truth is a solution with at least
thirty digits, which no certificate was compared with. The full search tries precisions, tolerances, held
invariants and the closed form from the cheapest up, until one keeps the accuracy at every sample compared.

Costs are counted, since clocks jitter: steps times the square of the Taylor order, times what a unit of
that costs in each precision (measured by ``calibrate``); seconds are reported beside it.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mpmath
import numpy as np

import rigidsim
from experiments import common
from experiments.common import Check
from experiments.random_scenes import RandomScene, random_scene
from rigidsim.errors import ConfigError
from rigidsim.scene.context import working_bits
from rigidsim.scene.reading import Experiment, parse_saved
from rigidsim.solve.status import Status
from rigidsim.trial import Setting, Trial, angles_between, try_setting

NAME = "accuracy_certificates"
_REDUCED, _FULL = 30, 200
_DEAR = 2.0  # times the cheapest
_MOST_ROWS = 400
_LONG = 2000.0  # rad: past it steps take too long to be the truth where there is a closed form
_TIGHT = 1e-15
_WIDE_ROWS = 128  # where the truth is a closed form: milliseconds each
_UNIT = {"single": 0.9, "double": 1.0, "extended": 9.0, "quadruple": 170.0, 50: 210.0}
_HELD = 1.1
_CLOSED = {"double": 6.0, "quadruple": 3000.0}
"""Cost of a step over order squared, relative to double precision, and of a sample of the closed form in
steps of double precision at its epsilon; ``calibrate`` measures them."""


@dataclass(frozen=True)
class Outcome:
    """What became of one scene.

    Attributes:
        refused: the message, where the run was refused before it began.
        certified, true, asked: rad; certified is nan where the scene was refused.
        ratio: counted cost over that of the cheapest of the full search; nan where nothing keeps it.
        seconds_ratio: the same of CPU seconds, measured once each; they jitter.
        cheapest: title of that.
        how: what the certificate compared with.
        certify_seconds, run_seconds: of the certificate, and of the whole run with it.
    """

    scene: RandomScene
    chosen: str
    refused: str
    certified: float
    true: float
    asked: float
    ratio: float
    seconds_ratio: float
    cheapest: str
    how: str
    certify_seconds: float
    run_seconds: float

    @property
    def kept(self) -> bool:
        """Whether the run was certified within the accuracy asked for."""
        return self.certified <= self.asked


def examine(scene: RandomScene, *, search: bool = True) -> Outcome:
    """Run a scene with its accuracy, and hold the certificate against the truth."""
    experiment = rigidsim.parse(scene.text)
    with tempfile.TemporaryDirectory() as folder:
        try:
            run = rigidsim.run(experiment, out=folder)
        except ConfigError as error:
            return _refused(scene, experiment, str(error))
        if run.status != "finished":
            raise RuntimeError(f"scene {scene.number}: {run.status}: {run.summary['message']}")
        with run.dataset as dataset:
            count = dataset.sizes["time"]
            setting = _setting_of(parse_saved(dataset.attrs["config"], source=NAME))
            reference = _truth_setting(experiment, setting, scene, str(run.summary["accuracy"]["how"]))
            most = _WIDE_ROWS if reference.method == "closed_form" else _MOST_ROWS
            rows = np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))
            times = _exact(dataset, rows)
            attitudes = _parts(dataset, "quaternion", rows)
        summary = run.summary
    truth = try_setting(experiment, reference, times, compact=True)
    accuracy = summary["accuracy"]
    certified = accuracy.get("certified")
    true = float(angles_between(attitudes, truth.attitudes).max())
    cost = summary["cost"]
    spent = counted(setting, cost["steps"], count)
    ratio = seconds_ratio = math.nan
    cheapest = ""
    if search:
        found = Search(experiment, scene.accuracy, times, truth).run(count)
        if found is not None:
            ratio = spent / counted(found.setting, found.steps, count)
            seconds_ratio = cost["seconds"]["engine"] / max(found.cpu_seconds, 1e-4)
            cheapest = found.setting.title
    return Outcome(
        scene,
        setting.title,
        "",
        math.inf if certified is None else certified,
        true,
        scene.accuracy,
        ratio,
        seconds_ratio,
        cheapest,
        str(accuracy.get("how")),
        cost["seconds"].get("certify", math.nan),
        sum(v for k, v in cost["seconds"].items() if k != "engine"),
    )


def _refused(scene: RandomScene, experiment: Experiment, text: str) -> Outcome:
    """Right if nothing in the full search keeps the accuracy."""
    last = _last(experiment)
    times = [mpmath.mpf(float(x)) for x in np.linspace(0, last, 101)[1:]]
    truth = try_setting(experiment, _truth_setting(experiment, Setting(), scene), times, compact=True)
    found = Search(experiment, scene.accuracy, times, truth).run(len(times))
    nothing = math.nan
    title = "" if found is None else found.setting.title
    return Outcome(
        scene, "", text, nothing, nothing, scene.accuracy, nothing, nothing, title, "", nothing, nothing
    )


def counted(setting: Setting, steps: int, samples: int) -> float:
    """Cost in steps of double precision at its epsilon."""
    if setting.method == "closed_form":
        return samples * _CLOSED.get(str(setting.precision), _CLOSED["quadruple"])
    unit = _UNIT.get(setting.precision, _UNIT[50])
    if isinstance(setting.precision, int):
        unit *= max(1.0, setting.precision / 50)
    return steps * (_order(setting) / 20) ** 2 * unit * (_HELD if setting.hold_invariants else 1.0)


def _order(setting: Setting) -> int:
    """Of the Taylor series: Jorba and Zou 2005, eq. 11."""
    epsilon = math.log(2.0) * (working_bits(setting.precision) - 1)
    tolerance = epsilon if setting.tolerance is None else -math.log(setting.tolerance)
    return max(2, math.ceil(tolerance / 2 + 1))


_TOLERANCES: dict[str, tuple[float | None, ...]] = {
    "single": (1e-4, 1e-6, None),
    "double": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, None),
    "extended": (1e-12, 1e-14, 1e-16, 1e-18, None),
    "quadruple": (1e-16, 1e-18, 1e-20, 1e-22, 1e-24, 1e-26, 1e-28, 1e-30, 1e-32, None),
}


class Search:
    """The cheapest setting that keeps an accuracy at all times compared.

    Errors fall with the tolerance, so that each precision's tolerances, held and not, are searched by
    bisection; what can't be cheaper than the best so far isn't tried.
    """

    def __init__(self, experiment: Experiment, accuracy: float, times: Sequence[Any], truth: Trial) -> None:
        self._experiment, self._accuracy, self._times, self._truth = experiment, accuracy, times, truth
        self._given = experiment.config.integrator.model_fields_set
        self.best: Trial | None = None
        self.cost = math.inf
        self._steps = 0

    def run(self, samples: int) -> Trial | None:
        """Look through everything; None where nothing keeps the accuracy."""
        self._samples = samples
        if "method" not in self._given:
            for precision in ("double", "quadruple"):
                if self._allowed(precision) and self._keeps(Setting(precision, method="closed_form")):
                    break
        for precision, tolerances in _TOLERANCES.items():
            if self._allowed(precision) and 2.0 ** (1 - working_bits(precision)) < 1e3 * self._accuracy:
                for held in (False, True):
                    self._bisect([Setting(precision, t, hold_invariants=held) for t in tolerances])
        return self.best

    def _allowed(self, precision: str) -> bool:
        return "precision" not in self._given or precision == self._experiment.config.integrator.precision

    def _bisect(self, family: list[Setting]) -> None:
        low, high = -1, len(family)
        if self._steps:
            while high > 0 and counted(family[high - 1], self._steps, self._samples) >= self.cost:
                high -= 1
        expected = [i for i, s in enumerate(family) if (s.tolerance or 0.0) <= self._accuracy]
        middle = expected[0] if expected else len(family) - 1
        while high - low > 1:
            middle = min(max(middle, low + 1), high - 1)
            if self._keeps(family[middle]):
                high = middle
            else:
                low = middle
            middle = (low + high) // 2

    def _keeps(self, setting: Setting) -> bool:
        try:
            trial = try_setting(self._experiment, setting, self._times, compact=True)
        except ConfigError:  # nothing to hold, no closed form
            return False
        if trial.status is not Status.FINISHED or trial.rows != len(self._times):
            return False
        self._steps = trial.steps or self._steps
        right = float(angles_between(trial.attitudes, self._truth.attitudes).max()) <= self._accuracy
        cost = counted(setting, trial.steps, self._samples)
        if right and cost < self.cost:
            self.best, self.cost = trial, cost
        return right


def _truth_setting(experiment: Experiment, setting: Setting, scene: RandomScene, how: str = "") -> Setting:
    """Twelve digits and more beyond the accuracy, and another precision or method than the certificate's."""
    digits = max(60, int(working_bits(setting.precision) * 0.302) + 40)  # and more than the run has
    closed = Setting(digits, method="closed_form")
    if "closed form" not in how or scene.radians > _LONG:
        try:
            try_setting(experiment, closed, [mpmath.mpf(_last(experiment))])
            return closed
        except ConfigError:  # it has none
            pass
    elif scene.accuracy >= _TIGHT:
        return Setting("quadruple", 1e-30)
    if working_bits(setting.precision) <= 53 and scene.accuracy >= _TIGHT:
        return Setting("quadruple", 1e-26)
    return Setting(digits, scene.accuracy * 1e-12)


def _last(experiment: Experiment) -> float:
    """Seconds."""
    from rigidsim.scene.scene import build_scene

    return float(build_scene(experiment).samples.last)


def _setting_of(experiment: Experiment) -> Setting:
    integrator = experiment.config.integrator
    tolerance = integrator.tolerance
    return Setting(
        integrator.precision,
        None if isinstance(tolerance, str) else float(tolerance.rational),
        "quaternion" if integrator.formulation == "auto" else integrator.formulation,
        integrator.hold_invariants,
        integrator.method,
    )


def _exact(dataset: Any, rows: np.ndarray) -> list[Any]:
    with mpmath.workprec(600):
        return [mpmath.fsum(map(float, row)) for row in zip(*_parts(dataset, "time", rows), strict=True)]


def _parts(dataset: Any, name: str, rows: np.ndarray) -> list[np.ndarray]:
    names = [name, *(n for n in (f"{name}_lo", *(f"{name}_lo{i}" for i in range(2, 20))) if n in dataset)]
    return [np.asarray(dataset[n].values[rows]) for n in names]


def campaign(full: bool, out: Path) -> list[Check]:
    """Violations, refusals and cost ratios over random scenes; 200 of them with ``full``."""
    outcomes = [examine(random_scene(number)) for number in range(_FULL if full else _REDUCED)]
    _figure(outcomes, out)
    run = [o for o in outcomes if not o.refused]
    ratios = np.array([o.ratio for o in run if math.isfinite(o.ratio)])
    seconds = np.array([o.seconds_ratio for o in run if math.isfinite(o.seconds_ratio)])
    shares = ", ".join(f"{q:.0%} {np.quantile(ratios, q):.2f}" for q in (0.5, 0.75, 0.9, 1.0))
    clocked = ", ".join(f"{q:.0%} {np.quantile(seconds, q):.2f}" for q in (0.5, 0.75, 0.9))
    print(f"{len(outcomes)} scenes, {len(outcomes) - len(run)} refused before the run")
    print(f"counted cost over the cheapest of the full search: {shares} (of CPU seconds: {clocked})")
    certified = float(np.median([o.certify_seconds for o in run]))
    print(f"seconds to certify a run: median {certified:.2g}, most {max(o.certify_seconds for o in run):.2g}")
    broken = sum(not o.true <= o.certified for o in run)
    promised = sum(o.kept and not o.true <= o.asked for o in run)
    kept = sum(o.kept for o in run) / len(run)
    wrong = sum(bool(o.cheapest) for o in outcomes if o.refused)
    cheap = float(np.mean(ratios <= _DEAR))
    source = "quadruple precision, 60 digits or closed form"
    asked = "asked for: nine in ten within a factor of 2"
    return [
        Check("scenes whose true error exceeds the certificate", broken, 0, 0.0, "1", source, "absolute"),
        Check("scenes certified that miss the accuracy", promised, 0, 0.0, "1", source, "absolute"),
        Check("scenes refused that a setting could do", wrong, 0, 0.0, "1", "full search", "absolute"),
        Check("share of runs certified within the accuracy", kept, 1.0, 0.02, "1", "every run", "absolute"),
        Check("share of runs at most twice the cheapest", cheap, 1.0, 0.1, "1", asked, "absolute"),
    ]


def _figure(outcomes: Sequence[Outcome], out: Path) -> None:
    run = [o for o in outcomes if not o.refused]
    figure = common.new_figure(12, 5.2, "An accuracy asked for is kept, certified, and cheap")
    left, right = figure.subplots(1, 2)
    asked = np.array([o.asked for o in run])
    ends = np.array([asked.min() / 3, asked.max() * 3])
    left.loglog(ends, ends, color=common.GREY, linewidth=1, label="accuracy asked for")
    left.vlines(
        asked, [max(o.true, 1e-40) for o in run], [o.certified for o in run], color="#cccccc", linewidth=0.8
    )
    left.loglog(asked, [o.certified for o in run], "v", color=common.ORANGE, markersize=4, label="certified")
    left.loglog(asked, [o.true for o in run], "o", color=common.BLUE, markersize=3, label="true")
    common.tidy(
        left, "attitude error asked for, rad", "attitude error, rad", "true <= certified <= asked for"
    )
    left.legend(frameon=False, loc="upper left")
    ratios = [o.ratio for o in run if math.isfinite(o.ratio)]
    right.hist(np.clip(ratios, 0.1, 9.9), bins=np.geomspace(0.1, 10, 41), color=common.BLUE)
    right.set_xscale("log")
    right.axvline(_DEAR, color=common.RED, linewidth=1, label="twice the cheapest")
    share = np.mean(np.array(ratios) <= _DEAR)
    title = f"{share:.0%} of {len(ratios)} runs cost at most twice the cheapest setting of a full search"
    common.tidy(right, "counted cost over the cheapest", "runs", title)
    right.legend(frameon=False)
    common.save(figure, out, NAME)


def calibrate() -> dict[str, float]:
    """What counted costs rest on, measured: CPU of a step over order squared, relative to double precision.

    Medians of five; of a free asymmetric body.
    """
    text = random_scene(1).text
    lines = [x for x in text.splitlines() if not x.startswith("accuracy")]
    experiment = rigidsim.parse("\n".join(lines))
    found: dict[str, float] = {}
    for precision in ("double", "single", "extended", "quadruple", 50):
        for held in (False, True):
            trials = [try_setting(experiment, Setting(precision, hold_invariants=held)) for _ in range(5)]
            unit = float(np.median([t.cpu_seconds / t.steps / t.order**2 for t in trials]))
            found[f"{precision}{' held' * held}"] = unit
    return {name: unit / found["double"] for name, unit in found.items()}


if __name__ == "__main__":
    raise SystemExit(common.main(campaign, NAME))
