"""Certified accuracy of a run: its attitude against an independent, better solution at a set of times.

The certified error is the largest difference found, plus a margin for the times between those compared, plus
the reference's own error (``rigidsim.accuracy.reference``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.accuracy.comparison import (
    angles_between,
    distances_between,
    exact_times,
    parts_of,
    rows_to_compare,
)
from rigidsim.accuracy.motion import KnownMotion, motion_of
from rigidsim.accuracy.reference import (
    AS_BAD,
    INCOMPARABLE,
    PEER_SAFETY,
    PICKED_SAFETY,
    SAFETY,
    TIMES,
    WIDE_TIMES,
    Reference,
    ReferenceKind,
    own_error,
    references,
    scatter_of,
)
from rigidsim.accuracy.setting import Setting, setting_of
from rigidsim.accuracy.trial import Told, Trial, Trials, try_setting
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment

if TYPE_CHECKING:
    import xarray


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
    told: Told | None = None,
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
        settled = compared.largest - compared.own > accuracy and compared.largest < INCOMPARABLE
        if verdict(best, accuracy, accuracy_position) is None or settled:
            break
    return best


class _Compared:
    """A run's recorded attitudes, and other solutions at the same times."""

    def __init__(self, dataset: xarray.Dataset, trials: Trials, motion: KnownMotion) -> None:
        self.setting = setting_of(trials.experiment)
        self._trials, self._motion = trials, motion
        self._count = dataset.sizes["time"]
        self._rows = {most: rows_to_compare(dataset, most) for most in (TIMES, WIDE_TIMES)}
        everything = np.unique(np.concatenate(list(self._rows.values())))
        self._place = {row: n for n, row in enumerate(everything)}
        self._times = exact_times(dataset, everything)
        if "quaternion" in dataset:
            self._parts = parts_of(dataset, "quaternion", everything)
        else:
            self._parts = self._again(trials).attitudes
        self._places: list[np.ndarray] | None = None
        if trials.experiment.config.integrator.accuracy_position is not None:
            if "position" in dataset:
                self._places = parts_of(dataset, "position", everything)
            else:
                self._places = self._again(trials).places
        self.largest = self.own = math.inf

    def _again(self, trials: Trials) -> Trial:
        """The run once more, for what it didn't record."""
        return try_setting(trials.experiment, self.setting, self._times, loads=trials.loads, repeating=True)

    def against(self, reference: Reference) -> Certificate | None:
        """The certificate that a reference gives; None if it is impossible."""
        rows = self._rows[WIDE_TIMES if reference.kind is ReferenceKind.CLOSED_FORM else TIMES]
        safety = SAFETY if len(rows) == self._count else PICKED_SAFETY
        if reference.kind is ReferenceKind.PEER:
            safety = PEER_SAFETY
        places = [self._place[row] for row in rows]
        times = [self._times[place] for place in places]
        better = self._trials.whole(reference.setting, times)
        if better is None:
            return None
        attitudes = better.attitudes
        difference = angles_between([part[places] for part in self._parts], attitudes)

        def distance(other: Setting) -> float:
            found = self._trials.whole(other, times)
            return math.inf if found is None else float(angles_between(found.attitudes, attitudes).max())

        self.largest = float(difference.max())
        self.own = own_error(reference, self.setting, self.largest, self._motion, distance)
        # recorded values can't be compared more closely than a quaternion's last bit
        floor = 2.0 ** (2 - self.setting.bits)
        error = safety * self.largest + self.own + floor
        if not self.largest < INCOMPARABLE:
            error = math.pi
        place = None
        if self._places is not None:
            apart = distances_between([part[places] for part in self._places], better.places)
            place = self._place_error(reference, float(apart.max()), safety)
            place += floor * max(float(np.abs(part).max()) for part in better.places)
        return Certificate(min(error, math.pi), float(difference[-1]), reference.how, len(rows), place)

    def _place_error(self, reference: Reference, apart: float, safety: float) -> float:
        """Bound of a path's error from its distance to the reference's path: the two errors are in the ratio
        of their errors per step, up to scatter.
        """
        if reference.kind is ReferenceKind.CLOSED_FORM:
            return safety * apart
        own = reference.setting
        share = own.level * scatter_of(own, self._motion.steps) / self.setting.level
        if own.bits <= self.setting.bits:
            share = AS_BAD
        return (safety + min(AS_BAD, share)) * apart


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
