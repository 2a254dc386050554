"""Certified accuracy of a run: its attitude against an independent, better solution at a set of times.

The certified error is the largest difference found, plus a margin for the times between those compared, plus
the reference's own error (``rigidsim.accuracy.motion``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
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
from rigidsim.accuracy.motion import KnownMotion, motion_of, references, scatter_of
from rigidsim.accuracy.setting import Setting, setting_of
from rigidsim.accuracy.trial import TrialProgress, finished_trial, try_setting
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment

if TYPE_CHECKING:
    import xarray

# With these no certificate of 300 random scenes was exceeded by the true error, and 199 of 200 runs were
# certified as they asked (``experiments/accuracy_certificates.py``).
_TIMES, _WIDE_TIMES = 4096, 129
"""Largest number of times compared; the latter for a closed form, which takes milliseconds per sample."""
_SAFETY, _PICKED_SAFETY, _PEER_SAFETY = 1.25, 2.0, 5.0
"""Factors on the largest difference: if all samples were compared; if only the fastest of each stretch, since
errors along the motion are largest where it is fastest; if the reference is no better than the run.
"""
_INCOMPARABLE = 0.5  # difference (rad) past which all digits are gone
_AS_BAD = 3.0  # error of a reference no better than the run, over the difference


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
    report: TrialProgress | None = None,
) -> Certificate | None:
    """Compare a finished run with an independent solution, as good as the accuracies asked for need (rad; m,
    None if the path need not be compared); None if the run recorded too little to be compared.
    """
    if dataset.sizes["time"] == 0:
        return None
    motion, setting = known or motion_of(experiment, loads=loads), setting_of(experiment)
    of_path = accuracy_position is not None

    @cache
    def run_at(most: int) -> tuple[list[mpmath.mpf], list[np.ndarray], list[np.ndarray]]:
        """Times, attitudes and places of the run; what it hasn't recorded, of the same run again."""
        rows = rows_to_compare(dataset, most)
        times = exact_times(dataset, rows)
        names = ["quaternion"] + ["position"] * of_path
        if all(name in dataset for name in names):
            attitudes, *places = (parts_of(dataset, name, rows) for name in names)
            return times, attitudes, places[0] if places else []
        again = try_setting(experiment, setting, times, loads=loads, repeating=True)
        return times, again.attitudes, again.places

    best: Certificate | None = None
    for reference in references(setting, motion, accuracy):
        times, attitudes, places = run_at(_TIMES if reference.has_steps else _WIDE_TIMES)
        better = finished_trial(experiment, reference, times, loads, report)
        if better is None:
            continue
        apart = angles_between(attitudes, better.attitudes)
        largest = float(apart.max())
        own = _own_share(reference, setting, motion, largest)
        safety = _SAFETY if len(times) == dataset.sizes["time"] else _PICKED_SAFETY
        how = f"against {reference.title}"
        if reference.has_steps and setting.has_steps and reference.level >= setting.level:
            safety, how = _PEER_SAFETY, f"{how}, which is independent but no more accurate"
        # recorded values can't be compared more closely than a quaternion's last bit; what is almost exact
        # errs by the rounding of its sample times
        floor = 2.0 ** (2 - setting.bits) + (0.0 if setting.has_steps else motion.labels(setting.precision))
        error = (safety + own) * largest + floor if largest < _INCOMPARABLE else math.pi
        place = None
        if of_path:
            off = float(distances_between(places, better.places).max())
            place = (safety + own) * off + floor * max(float(np.abs(part).max()) for part in better.places)
        found = Certificate(min(error, math.pi), float(apart[-1]), how, len(times), place)
        if best is None or found.error < best.error:
            best = found
        settled = (1 - own) * largest > accuracy and largest < _INCOMPARABLE
        if verdict(best, accuracy, accuracy_position) is None or settled:
            break
    return best


def _own_share(reference: Setting, setting: Setting, motion: KnownMotion, largest: float) -> float:
    """Bound of a reference's own error, over the largest difference from it: the motion amplifies both errors
    alike, however strongly. A run that is far better than its reference has no part in the difference.
    """
    if not reference.has_steps:
        return 0.0  # dozens of digits more than the run
    if not setting.has_steps:
        return _AS_BAD
    share = min(_AS_BAD, reference.level * scatter_of(reference, motion.steps) / setting.level)
    if reference.bits <= setting.bits:  # rounded coefficients and initial values are the same in both
        share = max(share, motion.rounding(reference.precision) / max(largest, 1e-300))
    return share


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
