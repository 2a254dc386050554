"""What files of sweeps hold as a place in a list keeps its place."""

from rigidsim.session.members import OUTCOMES, WARNINGS

OF_VERSION_1 = """
drift singularity no_effect attitude_uncertain rates_uncertain not_joined set_aside begun_anew not_certified
angle_without_unit ephemeris_of_earth never_happens time_without_unit model_uncertain undefined
length_without_unit below_surface period_contradicts gravity_upwards near_resonance model_unmeasured
delay_too_long friction_stiff strength_contradicts host_without_gravity
"""
OUTCOMES_OF_VERSION_1 = [
    "finished", "finished: event", "stopped: wall_time", "stopped: max_steps", "stopped: max_drift",
    "stopped: non-finite state", "stopped: step size collapsed", "stopped: switching unresolved", "refused",
    "failed", "stopped: impossible body", "stopped: out of range",
]  # fmt: skip


def test_places_of_warnings_and_outcomes() -> None:
    known = OF_VERSION_1.split()
    assert list(WARNINGS[: len(known)]) == known
    assert list(OUTCOMES[: len(OUTCOMES_OF_VERSION_1)]) == OUTCOMES_OF_VERSION_1
    assert len(WARNINGS) < 63  # bits of a whole number
