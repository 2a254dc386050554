"""How right is a run really: its attitude against an independent and better solution, at a set of times.

The reference is never the run's own arithmetic: it has more digits, or is the closed form, or (where more
digits would take too long) comes from other equations. What is certified is the largest difference found,
some more for what lies between the times compared, and what the reference itself may be wrong by: by the law
of rounding with the growth seen at the motion's beginning, and by the growth that the run itself shows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.accuracy import Choice
from rigidsim.archive import Run
from rigidsim.errors import ConfigError
from rigidsim.guards import Observer
from rigidsim.pilots import Forecast, epsilon, forecast
from rigidsim.recorded import exact_times, parts_of, rows_to_compare
from rigidsim.scene.context import working_bits
from rigidsim.scene.reading import Experiment
from rigidsim.solve.status import Status
from rigidsim.summary import UNCERTAIN
from rigidsim.trial import Setting, angles_between, setting_of, try_setting

if TYPE_CHECKING:
    from rigidsim.session import Session

_MOST_TIMES = 4096
_WIDE_TIMES = 129  # where a time compared costs milliseconds
_SAFETY = 1.25
_PICKED_SAFETY = 2.0
"""Over the largest difference found: where all samples were compared, and where the fastest of each stretch
were, since errors along the motion are largest where it is fastest."""
_PEER_SAFETY = 5.0  # where the reference is no better than the run, but independent of it
_CLEARLY = 0.01  # of the accuracy: what a reference with many digits is made to keep
_SCATTER = 100.0  # between errors of two settings over the ratio of their epsilons
_MUCH_BETTER = 1e-2  # than the run: references whose own error hardly matters
_AS_BAD = 3.0  # times the difference: what a reference no better than the run may be wrong by
_LOST = 0.5  # rad, past which a difference says nothing but that digits are gone
_WIDE_STEPS = 1e5  # in quadruple precision: a minute; beyond it an independent peer must do
_EXTENDED_STEPS = 1e5  # a second, spent on comparing every sample where a closed form gives some


@dataclass(frozen=True)
class Certificate:
    """What was found.

    Attributes:
        error: bound of the attitude error at the times compared, the end among them, rad.
        end: the difference found at the end itself, rad.
        how: against what.
        times: how many.
    """

    error: float
    end: float
    how: str
    times: int

    def as_dict(self) -> dict[str, Any]:
        """For the summary."""
        return {
            "certified": self.error,
            "difference_at_end": self.end,
            "how": self.how,
            "times_compared": self.times,
        }


def certify(
    run: Run,
    experiment: Experiment,
    *,
    accuracy: float,
    loads: Sequence[Any] = (),
    known: Forecast | None = None,
    observer: Observer | None = None,
) -> Certificate | None:
    """Compare a finished run with an independent solution.

    Args:
        experiment: that was run.
        accuracy: asked for, rad; decides how good the reference must be.
        known: of the motion, where it was looked at already.
        observer: is told of the comparisons.

    Returns:
        None where the run recorded too little to be compared.
    """
    setting = setting_of(experiment)
    known = known or forecast(experiment, loads=loads)
    with run.dataset as dataset:
        if dataset.sizes["time"] == 0:
            return None
        compared = _Compared(dataset, experiment, setting, known, loads, observer or Observer())
    best: Certificate | None = None
    for reference in _references(setting, known):
        found = compared.against(reference, accuracy)
        if found is None:
            continue
        if best is None or found.error < best.error:
            best = found
        settled = compared.largest - compared.own > accuracy and compared.largest < _LOST
        if best.error <= accuracy or settled:
            break
    return best


@dataclass(frozen=True)
class _Reference:
    """What a run may be compared with.

    Attributes:
        precision: of the reference; "same" for a peer.
        method: "taylor", "closed_form" or "peer".
    """

    precision: str | int
    method: str = "taylor"


def _references(setting: Setting, known: Forecast) -> list[_Reference]:
    """From cheap to costly; each is independent of the run."""
    bits = working_bits(setting.precision)
    loose = setting.method == "taylor" and setting.tolerance is not None
    found = []
    if bits <= 53 and loose and known.steps > _EXTENDED_STEPS:
        found.append(_Reference("double"))
    if bits <= 53 and (known.steps <= _EXTENDED_STEPS or not known.closed):
        found.append(_Reference("extended"))
    digits = max(50, int(bits * 0.302) + 20)
    if known.closed and setting.method == "taylor":
        found.append(_Reference("quadruple" if bits <= 64 else digits, "closed_form"))
    elif known.steps <= _WIDE_STEPS:
        found += [_Reference("quadruple")] * (bits <= 64)
        found.append(_Reference(digits))
    elif known.closed:  # too long for steps: the closed form must check itself, with many more digits
        found.append(_Reference(digits, "closed_form"))
    else:
        found.append(_Reference(setting.precision, "peer"))
    return found


def _level(setting: Setting) -> float:
    """Size of the errors made at each step."""
    return max(setting.tolerance or 0.0, epsilon(setting.precision))


class _Compared:
    """A run's recorded attitudes, and what others say at the same times.

    Attributes:
        largest: of the differences from the latest reference, rad.
        own: that reference's own error, at most, rad.
    """

    def __init__(
        self,
        dataset: Any,
        experiment: Experiment,
        setting: Setting,
        known: Forecast,
        loads: Sequence[Any],
        observer: Observer,
    ) -> None:
        self._observer = observer
        self._experiment, self._setting, self._known, self._loads = experiment, setting, known, loads
        self._count = dataset.sizes["time"]
        self._rows = {most: rows_to_compare(dataset, most) for most in (_MOST_TIMES, _WIDE_TIMES)}
        everything = np.unique(np.concatenate(list(self._rows.values())))
        self._place = {row: n for n, row in enumerate(everything)}
        self._times = exact_times(dataset, everything)
        if "quaternion" in dataset:
            self._parts = parts_of(dataset, "quaternion", everything)
        else:
            self._parts = try_setting(experiment, setting, self._times, loads=loads).attitudes
        self.largest = self.own = math.inf

    def against(self, reference: _Reference, accuracy: float) -> Certificate | None:
        """The certificate that a reference gives; None where it can't be had."""
        setting, known = self._setting, self._known
        safety = _SAFETY
        rows = self._rows[_WIDE_TIMES if reference.method == "closed_form" else _MOST_TIMES]
        if len(rows) < self._count:
            safety = _PICKED_SAFETY
        if reference.method == "closed_form":
            other = Setting(reference.precision, method="closed_form")
            how = f"against the closed form, {reference.precision}"
        elif reference.method == "peer":
            formulation = "rotation_matrix" if setting.formulation == "quaternion" else "quaternion"
            other = replace(setting, formulation=formulation, tolerance=None, method="taylor")
            how, safety = f"against {other.title}, which is independent but no more accurate", _PEER_SAFETY
        else:
            held = known.holds and working_bits(reference.precision) <= 64
            tolerance = self._tolerance(reference, accuracy)
            other = Setting(reference.precision, tolerance, hold_invariants=held)
            how = f"against {other.title}"
        attitudes = self._attitudes(other, rows)
        if attitudes is None:
            return None
        places = [self._place[row] for row in rows]
        difference = angles_between([part[places] for part in self._parts], attitudes)
        self.largest = float(difference.max())
        self.own = self._own(other, attitudes, rows)
        # a quaternion's own last bit: what is recorded can't be compared more closely
        floor = 2.0 ** (2 - working_bits(setting.precision))
        error = safety * self.largest + self.own + floor
        if not self.largest < _LOST:
            error = math.pi
        return Certificate(min(error, math.pi), float(difference[-1]), how, len(rows))

    def _attitudes(self, setting: Setting, rows: np.ndarray) -> list[np.ndarray] | None:
        times = [self._times[self._place[row]] for row in rows]
        try:
            trial = try_setting(
                self._experiment,
                setting,
                times,
                loads=self._loads,
                compact=True,
                told=self._observer.trying,
            )
        except ConfigError:  # a chart or a load that the reference can't have
            return None
        return trial.attitudes if trial.rows == len(times) else None

    def _own(self, reference: Setting, attitudes: list[np.ndarray], rows: np.ndarray) -> float:
        """What a reference may be wrong by, as differences from it show.

        All solutions go along the same motion, which amplifies the errors of all alike, however strongly
        (a pilot may not have seen that): the reference's are smaller as its errors per step are.
        """
        setting, known = self._setting, self._known
        if reference.method == "closed_form":
            return 0.0  # dozens of digits more than the run
        level = _level(reference) * self._scatter(reference)
        if setting.method == "taylor":
            estimate = self.largest * min(_AS_BAD, level / _level(setting))
            if working_bits(reference.precision) <= working_bits(setting.precision):
                # rounded coefficients and initial values are the same in both
                return max(estimate, known.rounding(reference.precision))
            if level <= _MUCH_BETTER * _level(setting):
                return estimate
        else:
            estimate = math.inf
        for precision in ("double", "extended"):
            probe = Setting(precision)
            if _level(reference) > _MUCH_BETTER * _level(probe):
                break
            there = self._attitudes(probe, rows)
            found = math.inf if there is None else float(angles_between(there, attitudes).max())
            if found < _LOST:
                return min(estimate, max(found, _level(probe)) * level / _level(probe))
        return min(estimate, known.rounding("double") * level / epsilon("double"))

    def _scatter(self, reference: Setting) -> float:
        """Between errors of two settings over the ratio of their levels; the series' add up, rounding's
        walk at random.
        """
        return _SCATTER if reference.tolerance is None else _SCATTER + 10 * math.sqrt(self._known.steps)

    def _tolerance(self, reference: _Reference, accuracy: float) -> float | None:
        """Of a reference with many digits, of which it needs less than all; None for its epsilon."""
        if working_bits(reference.precision) <= 64:
            return None
        known = self._known
        law = known.rounding("double") / epsilon("double")
        tolerance = _CLEARLY * accuracy / max(1.0, law) / (_SCATTER + 10 * math.sqrt(known.steps))
        tolerance = min(tolerance, _CLEARLY * _level(self._setting))
        return tolerance if tolerance > epsilon(reference.precision) else None


def verdict(certificate: Certificate, accuracy: float) -> str | None:
    """A warning where the accuracy asked for wasn't certified; None where it was."""
    if certificate.error <= accuracy:
        return None
    found = min(certificate.error, math.pi)
    return (
        f"accuracy = {accuracy:.3g} rad was asked for, but only {found:.2g} rad could be certified "
        f"({certificate.how}); choose a higher precision or a nearer end"
    )


def certified(
    result: Run,
    experiment: Experiment,
    choice: Choice | None,
    session: Session,
    loads: Sequence[Any] = (),
) -> tuple[Run, bool]:
    """A finished run's certificate, put into its summary, where ``accuracy`` asks for one.

    Args:
        session: that the run was made in; the certificate's cost is part of its.

    Returns:
        The run, and False where the accuracy was not kept.
    """
    asked = experiment.config.integrator.accuracy
    if asked is None or result.status not in (Status.FINISHED.value, Status.EVENT.value):
        return result, True
    session.observer.phase("certify")
    accuracy = float(asked.rational)
    found = certify(
        result,
        experiment,
        accuracy=accuracy,
        loads=loads,
        known=None if choice is None else choice.known,
        observer=session.observer,
    )
    summary = {**result.summary, "accuracy": {**result.summary["accuracy"], "requested": accuracy}}
    doubt: str | None = "too little was recorded to certify the accuracy asked for"
    if found is not None:
        doubt = verdict(found, accuracy)
        summary["accuracy"] |= found.as_dict()
    if choice is not None:
        words = {"chosen": choice.setting.title, "chosen_why": choice.why, "forecast": choice.forecast}
        summary["accuracy"] |= words
    if doubt is None:  # what is certified needs no estimate
        summary["warnings"] = [w for w in summary["warnings"] if not w.startswith(UNCERTAIN)]
    else:
        summary["warnings"] = [*summary["warnings"], doubt]
    session.phases.next("certify")
    summary["cost"] = {
        **summary["cost"],
        "seconds": dict(session.phases.wall),
        "cpu_by_phase": dict(session.phases.cpu),
        "cpu_seconds": session.effort.cpu,
        "wall_seconds": session.effort.wall,
    }
    result.folder.write_summary(summary)
    return Run(result.folder, summary), doubt is None
