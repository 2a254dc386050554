"""Warnings about a result: their codes, and their texts for people."""

from dataclasses import dataclass
from enum import StrEnum


class WarningCode(StrEnum):
    """Why a result can't be trusted, or not wholly: the words of summaries.

    Datasets of sweeps hold a bit for each in this order, so that new ones come last.
    """

    DRIFT = "drift"
    SINGULARITY = "singularity"
    NO_EFFECT = "no_effect"
    ATTITUDE_UNCERTAIN = "attitude_uncertain"
    RATES_UNCERTAIN = "rates_uncertain"
    NOT_JOINED = "not_joined"
    SET_ASIDE = "set_aside"
    BEGUN_ANEW = "begun_anew"
    NOT_CERTIFIED = "not_certified"
    ANGLE_WITHOUT_UNIT = "angle_without_unit"
    EPHEMERIS_OF_EARTH = "ephemeris_of_earth"
    NEVER_HAPPENS = "never_happens"
    TIME_WITHOUT_UNIT = "time_without_unit"
    MODEL_UNCERTAIN = "model_uncertain"
    UNDEFINED = "undefined"
    LENGTH_WITHOUT_UNIT = "length_without_unit"
    BELOW_SURFACE = "below_surface"
    PERIOD_CONTRADICTS = "period_contradicts"
    GRAVITY_UPWARDS = "gravity_upwards"
    NEAR_RESONANCE = "near_resonance"
    MODEL_UNMEASURED = "model_unmeasured"
    DELAY_TOO_LONG = "delay_too_long"
    FRICTION_STIFF = "friction_stiff"
    STRENGTH_CONTRADICTS = "strength_contradicts"
    HOST_WITHOUT_GRAVITY = "host_without_gravity"
    SERIES_DIVERGES = "series_diverges"


@dataclass(frozen=True)
class Caution:
    """A warning: its code (a ``WarningCode``, or a later version's word), and its text for people."""

    code: str
    text: str
