"""How right is a run really: its attitude against an independent and better solution, at a set of times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import mpmath
import numpy as np

from rigidsim.accuracy import Choice, Forecast, forecast
from rigidsim.archive import Run
from rigidsim.guards import Observer
from rigidsim.scene.context import working_bits
from rigidsim.scene.reading import Experiment
from rigidsim.solve.status import Status
from rigidsim.summary import UNCERTAIN
from rigidsim.trial import Setting, angles_between, try_setting

_MOST_TIMES = 33
_SAFETY = 1.5
"""Between the largest difference found and what is certified: the reference isn't exact, and errors between
the times compared can be somewhat larger than at them."""
_PEER_SAFETY = 5.0  # where the reference is no better than the run, but independent of it
_CLEARLY = 0.1  # of the accuracy: what a reference must be forecast to keep
_HIGHER: dict[str, str | int] = {
    "single": "double",
    "double": "extended",
    "extended": "quadruple",
    "quadruple": 50,
}
_QUADRUPLE_STEPS = 2e5  # a minute or two; beyond it an independent peer must do
_EXTENDED_STEPS = 1e5  # a second, spent on not trusting a closed form to check itself


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
    run: Run, experiment: Experiment, *, accuracy: float, loads: Sequence[Any] = ()
) -> Certificate | None:
    """Compare a finished run with an independent solution.

    Args:
        experiment: that was run.
        accuracy: asked for, rad; decides how good the reference must be.

    Returns:
        None where the run recorded too little to be compared.
    """
    setting = setting_of(experiment)
    with run.dataset as dataset:
        count = dataset.sizes["time"]
        if count == 0:
            return None
        rows = np.unique(np.linspace(0, count - 1, min(count, _MOST_TIMES)).astype(int))
        times = _exact_times(dataset, rows)
        recorded = "quaternion" in dataset
        parts = _parts(dataset, "quaternion", rows) if recorded else []
    known = forecast(experiment, loads=loads)
    if not recorded:
        parts = try_setting(experiment, setting, times, loads=loads).attitudes
    reference, factor, how = _reference(setting, known, accuracy)
    trial = try_setting(experiment, reference, times, loads=loads)
    if trial.rows != len(times):
        return None
    difference = angles_between(parts, trial.attitudes)
    own = 0.0
    if reference.method == "taylor" and factor == _SAFETY:
        own = known.rounding(reference.precision, held=False)
        if reference.tolerance is None and reference.hold_invariants:
            own = known.rounding(reference.precision, held=True)
    # a quaternion's own last bit: what is recorded can't be compared more closely
    floor = 2.0 ** (2 - working_bits(setting.precision))
    error = factor * float(difference.max()) + own + floor
    return Certificate(error, float(difference[-1]), how, len(times))


def setting_of(experiment: Experiment) -> Setting:
    """The setting that an experiment's ``[integrator]`` stands for."""
    integrator = experiment.config.integrator
    tolerance = integrator.tolerance
    return Setting(
        integrator.precision,
        None if isinstance(tolerance, str) else float(tolerance.rational),
        "quaternion" if integrator.formulation in ("auto", "rates") else integrator.formulation,
        integrator.hold_invariants,
        integrator.method,
    )


def _reference(setting: Setting, known: Forecast, accuracy: float) -> tuple[Setting, float, str]:
    """The setting to compare with, the safety factor, and what to call it."""
    higher = _HIGHER.get(str(setting.precision))
    if higher is None:
        higher = min(250, int(setting.precision) + 30)
    if known.closed:
        checked = setting.method == "closed_form" and setting.precision == "double"
        if checked and known.steps <= _EXTENDED_STEPS:
            reference = Setting("extended", hold_invariants=known.holds)
            return reference, _SAFETY, f"against {reference.title}"
        precision = higher if working_bits(higher) > 64 else "quadruple"
        return Setting(precision, method="closed_form"), _SAFETY, f"against the closed form, {precision}"
    ladder: dict[str | int, None] = dict.fromkeys(("double", "extended", "quadruple", higher))
    for precision in ladder:
        bits = working_bits(precision)
        better = Setting(precision, hold_invariants=known.holds)
        finer = bits > working_bits(setting.precision)
        finer = finer or (precision == setting.precision and setting.tolerance is not None)
        affordable = bits <= 64 or known.steps <= _QUADRUPLE_STEPS
        sound = known.rounding(precision, held=False) <= _CLEARLY * accuracy
        if finer and affordable and (sound or precision == higher):
            return better, _SAFETY, f"against {better.title}"
    other = "rotation_matrix" if setting.formulation == "quaternion" else "quaternion"
    peer = replace(setting, formulation=other, tolerance=None)
    return peer, _PEER_SAFETY, f"against {peer.title}, which is independent but no more accurate"


def _exact_times(dataset: Any, rows: np.ndarray) -> list[Any]:
    parts = zip(*_parts(dataset, "time", rows), strict=True)
    with mpmath.workprec(1200):
        return [mpmath.fsum(float(part) for part in row) for row in parts]


def _parts(dataset: Any, name: str, rows: np.ndarray) -> list[np.ndarray]:
    """A variable's float64 parts at some rows."""
    names = [name, *(n for n in (f"{name}_lo", *(f"{name}_lo{i}" for i in range(2, 20))) if n in dataset)]
    return [np.asarray(dataset[n].values[rows]) for n in names]


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
    observer: Observer,
    loads: Sequence[Any] = (),
) -> tuple[Run, bool]:
    """A finished run's certificate, put into its summary, where ``accuracy`` asks for one.

    Returns:
        The run, and False where the accuracy was not kept.
    """
    asked = experiment.config.integrator.accuracy
    if asked is None or result.status != Status.FINISHED.value:
        return result, True
    observer.phase("certify")
    accuracy = float(asked.rational)
    found = certify(result, experiment, accuracy=accuracy, loads=loads)
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
    result.folder.write_summary(summary)
    return Run(result.folder, summary), doubt is None
