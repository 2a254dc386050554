"""The truth about a scene, and the cheapest setting that keeps an accuracy.

Costs are counted, since clocks jitter: ``rigidsim.accuracy.setting.cost`` of the steps really taken.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mpmath

from experiments.random_scenes import RandomScene
from rigidsim.accuracy.comparison import angles_between
from rigidsim.accuracy.error_law import closed_form_if_any
from rigidsim.accuracy.reference import ReferenceKind
from rigidsim.accuracy.setting import Setting, cost, epsilon
from rigidsim.accuracy.trial import Trial, Trials, trial_scene
from rigidsim.scene.config import Experiment

_LONG = 2000.0  # rad: past it steps take too long to be the truth where there is a closed form
_TIGHT = 1e-15
_TOLERANCES: dict[str, tuple[float | None, ...]] = {
    "double": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, None),
    "single": (1e-4, 1e-6, None),
    "extended": (1e-12, 1e-14, 1e-16, 1e-18, None),
    "quadruple": (1e-16, 1e-18, 1e-20, 1e-22, 1e-24, 1e-26, 1e-28, 1e-30, 1e-32, None),
}


def truth_setting(
    experiment: Experiment, setting: Setting, scene: RandomScene, against: ReferenceKind | None = None
) -> Setting:
    """Twelve digits and more beyond the accuracy, ten beyond the run's own tolerance (which is far below the
    accuracy where the motion lets errors grow), and another precision or method than the certificate's.

    Args:
        setting: of the run that is judged.
        against: the kind of reference that its certificate is by.
    """
    digits = max(60, int(setting.bits * 0.302) + 40)  # and more than the run has
    closed = Setting(digits, method="closed_form")
    if against is not ReferenceKind.CLOSED_FORM or scene.radians > _LONG:
        if closed_form_if_any(trial_scene(experiment, Setting()))[0] is not None:
            return closed
    elif scene.accuracy >= _TIGHT:
        return Setting("quadruple", 1e-30)
    if setting.bits <= 53 and scene.accuracy >= _TIGHT:
        return Setting("quadruple", 1e-26)
    own = 2.0 ** -(setting.bits - 1) if setting.tolerance is None else setting.tolerance
    return Setting(digits, min(scene.accuracy * 1e-12, own * 1e-10))


class Search:
    """The cheapest setting that keeps an accuracy at all times compared.

    Errors fall with the tolerance, so that each precision's tolerances, held and not, are searched by
    bisection; what can't be cheaper than the best so far isn't tried.

    Attributes:
        best: what was found so far; None before.
        cost: of that, or below which it must be.
    """

    def __init__(
        self,
        experiment: Experiment,
        accuracy: float,
        times: Sequence[mpmath.mpf],
        truth: Trial,
        *,
        steps: int = 0,
        below: float = math.inf,
    ) -> None:
        """Nothing is tried yet.

        Args:
            truth: at the times.
            steps: that the scene takes, roughly, for the cost of what wasn't tried; 0 where unknown.
            below: cost that is known to be enough: only cheaper settings are looked for.
        """
        self._experiment, self._accuracy, self._times, self._truth = experiment, accuracy, times, truth
        self._trials = Trials(experiment)
        self._given = experiment.config.integrator.model_fields_set
        self._steps = steps
        self.best: Trial | None = None
        self.cost = below

    def run(self, samples: int) -> Trial | None:
        """Look through everything; None where nothing keeps the accuracy at less than the known cost."""
        self._samples = samples
        if "method" not in self._given:
            for precision in ("double", "quadruple"):
                if self._allowed(precision) and self._keeps(Setting(precision, method="closed_form")):
                    break
        for precision, tolerances in _TOLERANCES.items():
            if self._allowed(precision) and epsilon(precision) < 1e3 * self._accuracy:
                for held in (False, True):
                    self._bisect([Setting(precision, t, hold_invariants=held) for t in tolerances])
        return self.best

    def _allowed(self, precision: str) -> bool:
        """Single precision only where it is given: a step costs more than one of double precision at the
        same tolerance (see ``calibration``) and is no better.
        """
        if "precision" in self._given:
            return precision == self._experiment.config.integrator.precision
        return precision != "single"

    def _bisect(self, family: list[Setting]) -> None:
        low, high = -1, len(family)
        while self._steps and high > 0 and self._cost(family[high - 1]) >= self.cost:
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

    def _cost(self, setting: Setting) -> float:
        return cost(setting, self._steps, self._samples)

    def _keeps(self, setting: Setting) -> bool:
        if not setting.has_steps and self._cost(setting) >= self.cost:
            return False
        trial = self._trials.whole(setting, self._times)
        if trial is None:
            return False
        self._steps = trial.steps or self._steps
        right = float(angles_between(trial.attitudes, self._truth.attitudes).max()) <= self._accuracy
        spent = cost(setting, trial.steps, self._samples)
        if right and spent < self.cost:
            self.best, self.cost = trial, spent
        return right
