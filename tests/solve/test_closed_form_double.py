"""The double path of the closed forms: right to rounding at any horizon, next to anything singular."""

import mpmath
import numpy as np
import pytest
from closed_scenes import EXTREMES, attitude_error, closed, scene, top
from support import cases, run_text

import rigidsim
from rigidsim import ConfigError

FAR = 1e8  # seconds; the fastest rates of these scenes are 0.3 to 25 rad/s, a rod's 1e12 about its axis
PHASE_ERROR = 1e-7  # rad, asked for at 1e8 rad: 10 eps times the phase is 2.2e-7


TURNING = [name for name in EXTREMES if "spin" not in name and "rod as a top" not in name][::4]


@pytest.mark.parametrize("name", cases(TURNING, TURNING[::3], daily=2))
def test_the_attitude_is_right_after_a_hundred_million_radians(name: str) -> None:
    form = closed(scene(**EXTREMES[name]))
    start = form.scene.quaternion
    seconds = FAR / max(1.0, float(max(abs(w) for w in form.scene.angular_velocity)))
    times = np.array([0.0, seconds * 0.37, seconds])
    rates, quaternion = form.rates_and_quaternions(times)
    assert attitude_error([mpmath.mpf(x) for x in start], quaternion[0] * _sign(start, quaternion[0])) < 1e-14
    for n, time in enumerate(times):
        exact_rates, exact = form.exactly(mpmath.mpf(float(time)), 25)
        assert attitude_error(exact, quaternion[n] * _sign(exact, quaternion[n])) < PHASE_ERROR
        size = 2.0**-form.scaling.time  # of the motion's rates: those of a pendulum at rest are zero
        assert np.linalg.norm(rates[n] - np.array([float(w) for w in exact_rates])) < PHASE_ERROR * size


def _sign(exact: list, quaternion: np.ndarray) -> float:
    return 1.0 if float(mpmath.fdot(exact, [float(q) for q in quaternion])) >= 0 else -1.0


FREE = """
name = "free"
[body]
principal_moments = [1, 2, 3]
[initial]
angular_velocity = [0.5, 0.25, 1]
[time]
end = 100
samples = 11
[integrator]
method = "closed_form"
"""


def test_a_top_and_a_throw_in_closed_form() -> None:
    heavy = FREE.replace("principal_moments = [1, 2, 3]", top(1, 0.5)).replace(
        "[time]", '[[loads]]\nkind = "uniform_gravity"\nacceleration = [0, 0, -1]\n[time]'
    )
    throw = FREE.replace(
        "[time]", 'position = [1, 2, 3]\nvelocity = [0, 0, 5]\n[[loads]]\nkind = "uniform_gravity"\n[time]'
    )
    throw = throw.replace("[1, 2, 3]\n[initial]", "[1, 2, 3]\nmass = 2\n[initial]")
    for text in (heavy, throw):
        one = run_text(text, "time.end=5", 'name="c"')
        two = run_text(text, "time.end=5", 'name="t"', 'integrator.method="taylor"')
        with one.dataset as a, two.dataset as b:
            assert set(a.data_vars) == set(b.data_vars)
            for name in ("quaternion", "angular_velocity", "position"):
                if name in a:
                    scale = np.abs(b[name].values).max()
                    assert np.abs(a[name].values - b[name].values).max() < 1e-12 * scale


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('[[loads]]\nkind = "gravity_gradient"\ngravitational_parameter = 1\nposition = [1, 0, 0]',
         "gravity_gradient has no closed form"),
        ('[[events]]\nname = "e"\nexpression = "wx"', r"remove \[\[events\]\]"),
        ("hold_invariants = true", ""),
        ('formulation = "euler_angles"', ""),
    ],
)  # fmt: skip
def test_what_has_none_is_refused(table: str, message: str) -> None:
    with pytest.raises(ConfigError, match=rf"\[integrator\] method: given \"closed_form\".*{message}"):
        rigidsim.plan(rigidsim.parse(f"{FREE}{table}\n"))
