"""Pulses and spikes late in a run: their impulse is the one that was written, not that of rounded times."""

import math
from itertools import product
from pathlib import Path

import mpmath
import numpy as np
import pytest
from support import EPSILON, cases, config, run_estimated, run_text, wide

FAULTS = Path(__file__).parents[1] / "data" / "faults"
LATE = config(
    "principal_moments = [1, 1, 1]",
    "angular_velocity = [0, 0, 0]",
    'kind = "torque"\ncomponents = [0, 0, "{torque}"]',
    "end = 1000\nsamples = 3",
    'precision = "{precision}"',
)


def turned(run: object) -> float:
    """Angle about the third axis at the end, between -pi and pi."""
    w, *_, z = run.dataset["quaternion"].values[-1]  # type: ignore[attr-defined]
    return 2 * math.atan2(z, w)


def apart(angle: float, exact: mpmath.mpf) -> float:
    """Difference of angles, less full turns."""
    with mpmath.workdps(40):
        return abs(float(mpmath.fmod(angle - exact + 101 * mpmath.pi, 2 * mpmath.pi) - mpmath.pi))


def test_a_short_pulse_has_the_impulse_that_was_written() -> None:
    run = run_estimated((FAULTS / "short_pulse.toml").read_text())
    assert run.dataset["angular_velocity"].values[-1].tolist() == [0, 0, 1]
    with mpmath.workdps(40):
        exact = mpmath.mpf(5000) - mpmath.mpf("1e-6") / 2
    assert apart(turned(run), exact) <= run.summary["accuracy"]["estimated_attitude_error"] < 1e-10


def test_a_smooth_spike_errs_by_rounding() -> None:
    run = run_estimated((FAULTS / "gauss_spike.toml").read_text())
    with mpmath.workdps(40):
        kick = mpmath.sqrt(mpmath.pi)  # 1e2 times 1e-2
        exact = mpmath.mpf(10000) + kick * (10000 - mpmath.mpf("5000.3"))
    announced = run.summary["accuracy"]["estimated_attitude_error"]
    # the round-off law, (eps / 2) sqrt(steps) |w| t / sqrt 3, with a margin of 3
    assert apart(turned(run), exact) <= 3 * EPSILON["double"] * math.sqrt(1e4) * 2.8 * 1e4 / math.sqrt(12)
    assert apart(turned(run), exact) <= announced < 1e-9


PAIRS = list(product(["single", "double", "extended"], ["pulse", "spike"]))


@pytest.mark.parametrize("case", cases(PAIRS, PAIRS[2:3]), ids="-".join)
def test_narrow_beside_the_last_digit_of_the_time(case: tuple[str, str]) -> None:
    """A pulse also where one number of the precision can't tell its beginning from its end."""
    precision, kind = case
    widths = {"single": ("2^-18", "2^-8"), "double": ("2^-47", "2^-30"), "extended": ("2^-50", "2^-36")}
    width = widths[precision][kind == "spike"]
    torque = "pulse(t, 700.3, 700.3 + {w})/{w}" if kind == "pulse" else "exp(-((t - 700.3)/{w})^2)/{w}"
    text = LATE.format(torque=torque.format(w=f"({width})"), precision=precision)
    gained = wide(run_text(text).dataset, "angular_velocity")[-1, 2]
    exact = 1 if kind == "pulse" else np.longdouble("1.7724538509055160273")  # sqrt(pi)
    # some fifty steps through the spike, each of which rounds the rate twice
    assert abs(gained - exact) <= (4 if kind == "pulse" else 2 * math.sqrt(50)) * EPSILON[precision]


U = "((t - 700.3)/{w})"
NARROW = {
    "triangle": (f"max(0, 1 - abs({U} - 1))", 1.0),
    "roof": ("max(0, {w} - abs(t - 700.3))/{w}", 1.0),
    "ramps": (f"min(max({U}, 0), 1) - min(max({U} - 3, 0), 1)", 3.0),
    "trapezium": (f"max(0, min(1, 2 - abs({U})))", 3.0),
    "two triangles": (f"max(0, 1 - abs(abs({U}) - 2))", 2.0),
    "sawtooth": (f"pulse(t, 700.3, 700.3 + {{w}})*{U}", 0.5),
    "overlap": (f"step(1 - abs({U}))*step(0.5 - abs({U} - 1))", 0.5),
    "parabola": (f"max(0, 1 - {U}^2)", 4 / 3),
    "square": (f"step(1 - {U}^2)", 2.0),
}
"""Functions of time, u = (t - 700.3)/w, with their integrals over u."""


def impulse(shape: str, spacings: float, precision: str) -> float:
    """The error of the rate that a narrow torque of order one impulse leaves, in roundings.

    Args:
        spacings: width over the spacing of the precision's numbers around 512.
    """
    torque, exact = NARROW[shape]
    width = repr(spacings * 512 * EPSILON[precision])
    text = LATE.format(torque=f"({torque})/{{w}}".format(w=width), precision=precision)
    run = run_text(text)
    assert run.summary["status"] == "finished"
    return float(abs(wide(run.dataset, "angular_velocity")[-1, 2] - exact)) / EPSILON[precision] / exact


@pytest.mark.parametrize("shape", cases(NARROW, ["parabola"]))
def test_nested_kinks_are_met_however_narrow(shape: str) -> None:
    """Also within the spacing of the times: nothing is passed over, no zero is taken for its neighbour."""
    # two moments in two numbers, each to half a spacing of the second, and two roundings of the rate
    for spacings in (0.3, 50.0):
        assert impulse(shape, spacings, "single") <= 1 / spacings + 2


def test_pulses_beyond_two_numbers_are_refused_with_the_reason() -> None:
    torque = "pulse(t, 700.3, 700.3 + 1e-40)*1e40"
    summary = run_text(LATE.format(torque=torque, precision="double")).summary
    assert summary["status"] == "stopped: switching unresolved"
    assert "two numbers of double precision don't resolve its impulse" in summary["message"]


@pytest.mark.parametrize("torque", ["exp(-((t - 700.3)/(2^-48))^2)/(2^-48)"])
def test_spikes_that_stop_a_run_are_told_with_what_to_do(torque: str) -> None:
    summary = run_text(LATE.format(torque=torque, precision="double")).summary
    assert summary["status"] == "stopped: non-finite state"
    for words in ("the resolution of time in double precision", "choose a higher precision"):
        assert words in summary["message"]
