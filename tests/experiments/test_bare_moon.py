"""The Moon written with heyoka alone, against DE421's librations, and its torques against potentials."""

import pytest

pytest.importorskip("heyoka")


def _left_over(days, without=()):
    pytest.importorskip("de421")
    from experiments.bare import moon

    computed = moon.Moon("de421", without)
    found = computed.integrate(days)
    rest = moon.left_over("de421", computed.start, found["days"], found["quaternion"])
    return {"rms": (rest**2).sum(axis=1).mean() ** 0.5, "components": abs(rest).max(axis=0)}


@pytest.mark.campaign  # two minutes
def test_fifty_years_and_what_each_effect_is_worth():
    """real amounts in arcsec, nothing fitted, of the published comparison (total rms over 1969-2019)."""
    full = _left_over(18264.0)
    assert full["rms"] < 0.4
    assert max(full["components"]) < 0.5
    published = {
        "core": 7.75,
        "degree4": 1.08,
        "core_flattening": 0.70,
        "distortion": 0.355,
        "delay": 0.29,
        "core_friction": 0.25,
        "figure": 0.107,
        "spin_distortion": 0.041,
    }
    for effect, amount in published.items():
        assert _left_over(18264.0, [effect])["rms"] / 1000 == pytest.approx(amount, rel=0.02), effect
