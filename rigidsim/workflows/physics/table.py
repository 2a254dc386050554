"""What ``plan --physics`` tells: typed values, which ``as_dict`` makes JSON of."""

from __future__ import annotations

import math

from rigidsim.store.summary_parts import SummaryPart

ARCSEC = math.degrees(1.0) * 3600.0
"""Arcseconds of a radian."""


class MeasuredModel(SummaryPart):
    """A model that was run.

    Attributes:
        rms_arcsec, largest_arcsec: angle between its attitudes and the full model's; of averages between the
            axes.
        operations: of its equations. cpu_seconds, steps: of its run, in the folder ``run``.
    """

    rms_arcsec: float
    largest_arcsec: float
    operations: int
    steps: int
    cpu_seconds: float
    run: str


class EffectWorth(MeasuredModel):
    """What leaving out one effect does, over the span; ``required``: whether the least model has it."""

    code: str
    words: str
    required: bool


class UnassessedEffect(SummaryPart):
    """An effect that wasn't assessed, and why."""

    what: str
    why: str


class AveragedLevel(SummaryPart):
    """A ``[model] level`` that averages, and the largest angle between its axes and the full model's."""

    level: str
    largest_arcsec: float


class ComparedModel(MeasuredModel):
    """A model that was run, against the full one.

    Attributes:
        left_out: codes of the effects that it doesn't have; of those with parts the whole alone.
        expected_arcsec: largest angle of the sum of what its effects do one by one.
        cost: steps times operations.
        within: whether its largest angle is within the error.
    """

    left_out: list[str]
    expected_arcsec: float
    cost: int
    within: bool


class PhysicsPlan(SummaryPart):
    """What each effect of a scene is worth, and the least model found within an error.

    Attributes:
        error_arcsec: the error asked for.
        effects: the most worth first.
        compared: the variable that angles are of: quaternion, or the axis of an average.
        tried: the models that were run in search of the least one, which is the last.
        uncertainty_arcsec: of the full model's attitude at the end by rounding; None if not estimated.
        written: file of the least model's config; None if none was asked for.
    """

    name: str
    error_arcsec: float
    compared: str
    span_s: float
    samples: int
    full: ComparedModel
    least: ComparedModel
    effects: list[EffectWorth]
    averaged: list[AveragedLevel]
    not_assessed: list[UnassessedEffect]
    tried: list[ComparedModel]
    uncertainty_arcsec: float | None
    warnings: list[str]
    folder: str
    figure: str
    written: str | None

    def __repr__(self) -> str:
        least = self.least
        without = ", ".join(least.left_out) or "nothing"
        rows = [f"  {x.code:24} {x.largest_arcsec:11.4g} arcsec" for x in self.effects]
        first = f"<Physics of {self.name!r} within {self.error_arcsec:.4g} arcsec: leave out {without}, "
        return "\n".join([f"{first}{least.largest_arcsec:.4g} arcsec", *rows]) + ">"
