"""Certified accuracy of a run: its attitude against an independent, better solution at a set of times.

The certified error is the largest difference found, plus a margin for the times between those compared, plus
the reference's own error (``rigidsim.accuracy.reference``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mpmath
import numpy as np

from rigidsim.accuracy.comparison import (
    angles_between,
    distances_between,
    exact_times,
    parts_of,
    rows_to_compare,
)
from rigidsim.accuracy.motion import KnownMotion, motion_of
from rigidsim.accuracy.reference import Reference, ReferenceKind, references, scatter_of
from rigidsim.accuracy.setting import Setting, setting_of
from rigidsim.accuracy.trial import TrialProgress, Trials, try_setting
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment

if TYPE_CHECKING:
    import xarray

# With these no certificate of 200 random scenes was exceeded by the true error, and 199 of these runs were
# certified as they asked (``experiments/accuracy_certificates.py``).
_TIMES, _WIDE_TIMES = 4096, 129
"""Largest number of times compared; the latter for a closed form, which takes milliseconds per sample."""
_SAFETY, _PICKED_SAFETY, _PEER_SAFETY = 1.25, 2.0, 5.0
"""Factors on the largest difference: if all samples were compared; if only the fastest of each stretch, since
errors along the motion are largest where it is fastest; if the reference is no better than the run.
"""
_INCOMPARABLE = 0.5  # difference (rad) past which all digits are gone
_AS_BAD = 3.0  # error of a reference no better than the run, over the difference
_MUCH_BETTER = 1e-2  # ratio of errors per step to the run's below which a reference's own hardly matter


@dataclass(frozen=True)
class Certificate:
    """Result of a certification: bound of the attitude error (rad) at the times compared, the difference
    found at the end, and a bound of the position error (m); None if no accuracy of it was asked for.
    """

    error: float
    end: float
    how: str
    times: int
    place: float | None = None

    def as_dict(self) -> dict[str, float | str | int]:
        """Values for the summary."""
        return {
            **({} if self.place is None else {"certified_position": self.place}),
            "certified": self.error,
            "difference_at_end": self.end,
            "how": self.how,
            "times_compared": self.times,
        }


def certify(
    dataset: xarray.Dataset,
    experiment: Experiment,
    *,
    accuracy: float,
    accuracy_position: float | None = None,
    loads: Sequence[Load] = (),
    known: KnownMotion | None = None,
    told: TrialProgress | None = None,
) -> Certificate | None:
    """Compare a finished run with an independent solution, as good as the accuracies asked for need (rad; m,
    None if the path need not be compared); None if the run recorded too little to be compared.
    """
    if dataset.sizes["time"] == 0:
        return None
    motion = known or motion_of(experiment, loads=loads)
    compared = _Compared(dataset, Trials(experiment, loads, told), motion)
    best: Certificate | None = None
    for reference in references(compared.setting, motion, accuracy):
        found = compared.against(reference)
        if found is None:
            continue
        if best is None or found.error < best.error:
            best = found
        settled = compared.largest - compared.own > accuracy and compared.largest < _INCOMPARABLE
        if verdict(best, accuracy, accuracy_position) is None or settled:
            break
    return best


class _Compared:
    """A run's recorded attitudes, and other solutions at the same times."""

    def __init__(self, dataset: xarray.Dataset, trials: Trials, motion: KnownMotion) -> None:
        self.setting = setting_of(trials.experiment)
        self._trials, self._motion = trials, motion
        self._count = dataset.sizes["time"]
        self._rows = {most: rows_to_compare(dataset, most) for most in (_TIMES, _WIDE_TIMES)}
        everything = np.unique(np.concatenate(list(self._rows.values())))
        self._place = {row: n for n, row in enumerate(everything)}
        self._times = exact_times(dataset, everything)
        experiment, loads = trials.experiment, trials.loads

        def recorded(name: str) -> list[np.ndarray]:
            if name in dataset:
                return parts_of(dataset, name, everything)
            again = try_setting(experiment, self.setting, self._times, loads=loads, repeating=True)
            return again.attitudes if name == "quaternion" else again.places

        self._parts = recorded("quaternion")
        of_path = experiment.config.integrator.accuracy_position is not None
        self._places = recorded("position") if of_path else None
        self.largest = self.own = math.inf

    def against(self, reference: Reference) -> Certificate | None:
        """The certificate that a reference gives; None if it is impossible."""
        rows = self._rows[_WIDE_TIMES if reference.kind is ReferenceKind.CLOSED_FORM else _TIMES]
        safety = _SAFETY if len(rows) == self._count else _PICKED_SAFETY
        if reference.kind is ReferenceKind.PEER:
            safety = _PEER_SAFETY
        places = [self._place[row] for row in rows]
        times = [self._times[place] for place in places]
        better = self._trials.whole(reference.setting, times)
        if better is None:
            return None
        difference = angles_between([part[places] for part in self._parts], better.attitudes)
        self.largest = float(difference.max())
        self.own = self._own_error(reference, times)
        # recorded values can't be compared more closely than a quaternion's last bit
        floor = 2.0 ** (2 - self.setting.bits)
        error = safety * self.largest + self.own + floor
        if not self.largest < _INCOMPARABLE:
            error = math.pi
        place = None
        if self._places is not None:
            apart = distances_between([part[places] for part in self._places], better.places)
            place = self._place_error(reference, float(apart.max()), safety)
            place += floor * max(float(np.abs(part).max()) for part in better.places)
        return Certificate(min(error, math.pi), float(difference[-1]), reference.how, len(rows), place)

    def _own_error(self, reference: Reference, times: Sequence[mpmath.mpf]) -> float:
        """Bound of a reference's own error, rad. A pilot may not have seen how strongly the motion amplifies
        errors; differences have, as the largest one from another setting's solution.
        """
        if reference.kind is ReferenceKind.CLOSED_FORM:
            return 0.0  # dozens of digits more than the run
        own, setting, motion = reference.setting, self.setting, self._motion
        level = own.level * scatter_of(own, motion.steps)
        estimate = math.inf
        if setting.has_steps:
            estimate = self.largest * min(_AS_BAD, level / setting.level)
            if own.bits <= setting.bits:  # rounded coefficients and initial values are the same in both
                return max(estimate, motion.rounding(own.precision))
            if level <= _MUCH_BETTER * setting.level:
                return estimate
        for probe in (Setting("double"), Setting("extended")):
            if own.level > _MUCH_BETTER * probe.level:
                break
            errors = self._trials.compare(probe, own, times)
            if errors is not None and (found := float(errors.max())) < _INCOMPARABLE:
                return min(estimate, max(found, probe.level) * level / probe.level)
        return min(estimate, motion.error(level))

    def _place_error(self, reference: Reference, apart: float, safety: float) -> float:
        """Bound of a path's error from its distance to the reference's path: the two errors are in the ratio
        of their errors per step, up to scatter.
        """
        if reference.kind is ReferenceKind.CLOSED_FORM:
            return safety * apart
        own = reference.setting
        share = own.level * scatter_of(own, self._motion.steps) / self.setting.level
        if own.bits <= self.setting.bits:
            share = _AS_BAD
        return (safety + min(_AS_BAD, share)) * apart


def verdict(
    certificate: Certificate,
    accuracy: float | None,
    accuracy_position: float | None = None,
    *,
    key: str = "accuracy",
) -> str | None:
    """Warning if the requested accuracies (rad, by a key of ``[integrator]``, and m of the path) weren't
    certified.
    """
    remedy = f"could be certified ({certificate.how}); choose a higher precision or a nearer end"
    if accuracy is not None and certificate.error > accuracy:
        found = f"only {min(certificate.error, math.pi):.2g} rad"
        return f"{key} = {accuracy:.3g} rad was asked for, but {found} {remedy}"
    place = certificate.place
    if accuracy_position is None or (place is not None and place <= accuracy_position):
        return None
    found = "nothing" if place is None else f"only {place:.2g} m"
    return f"accuracy_position = {accuracy_position:.3g} m was asked for, but {found} {remedy}"
