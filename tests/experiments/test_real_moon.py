"""The ready scene of the real Moon, beside DE421's librations and the same equations in heyoka alone."""

import pytest

pytest.importorskip("de421")
from experiments import real_moon
from experiments.bare import moon as bare
from experiments.common import simulate

YEAR = "time.end=368 day"


@pytest.mark.slow
def test_a_year_of_the_ready_scene_is_de421s_and_the_bare_programs() -> None:
    result = simulate(real_moon.SCENE, *real_moon.SPARSE, YEAR)
    assert real_moon.rms(real_moon.left_over(result)) < 0.1  # mas
    other = bare.Moon("de421").integrate(368.0)["quaternion"][::2]
    assert real_moon.apart(result, other) < 5e-10  # third order in the delay, which only the other has


@pytest.mark.slow
def test_without_a_delay_both_are_the_same_to_rounding() -> None:
    """And keys beside the preset count one by one."""
    result = simulate(real_moon.SCENE, *real_moon.SPARSE, YEAR, "body.elasticity.delay=0")
    other = bare.Moon("de421", ["delay"]).integrate(368.0)["quaternion"][::2]
    assert real_moon.apart(result, other) < 1e-12
