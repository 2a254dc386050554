"""Pulses and switches far shorter than the motion: no step passes over them."""

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from equations import EPS
from scipy.integrate import quad
from support import EPSILON, cases, config, run_text

import rigidsim

SPUN = config(
    "principal_moments = [1, 1.5, 2]",
    "angular_velocity = [0, 0, {spin}]",
    'kind = "torque"\ncomponents = [0, 0, "{torque}"]',
    "end = 100\nsamples = 11",
    'precision = "{precision}"',
    'record = ["angular_velocity", "work"]',
    '[parameters]\nw = "{width}"',
    estimate=True,
)


def spun(torque: str, runs: Path, *, width: str = "1", spin: str = "0.5", precision: str = "double",
         more: str = "", loads: Any = ()) -> rigidsim.Run:  # fmt: skip
    text = SPUN.format(width=width, torque=torque, spin=spin, precision=precision) + more
    return rigidsim.run(rigidsim.parse(text), out=runs, force=True, loads=loads)


@pytest.mark.parametrize(
    ("form", "precision", "width"),
    [
        pytest.param("exp(-((t-50)/w)^2)/w", "extended", "1e-2", marks=pytest.mark.slow),
        ("sigmoid((t-50)/w)*sigmoid((50-t)/w)/w", "double", "1e-4"),
    ],
)
def test_a_pulse_gives_its_whole_impulse_and_work(form: str, width: str, precision: str, runs: Path) -> None:
    """Whatever its width: sqrt(pi) or 1 N m s, and the balance of energy holds."""
    run = spun(form, runs, width=width, precision=precision)
    impulse = 1.0 if "sigmoid" in form else math.sqrt(math.pi)
    spin = run.dataset["angular_velocity"].values[:, 2]
    steps = run.summary["cost"]["steps"]
    # t is known to eps * 50 s, which is that over w of the pulse's argument; float64 is what is compared
    blur = EPSILON[precision] * 50 / float(width) * math.sqrt(steps)
    bound = 4 * EPS + 50 * EPSILON[precision] * math.sqrt(steps) + blur
    assert spin[-1] - 0.5 == pytest.approx(impulse / 2, rel=bound)
    work = run.dataset["work"].values[-1]
    assert work == pytest.approx((0.5 + impulse / 2) ** 2 - 0.25, rel=3 * bound)
    row = run.summary["invariants"]["energy_balance"]
    assert row["largest_drift"] <= row["bound"]
    assert not run.summary["warnings"]
    # the way there and back costs steps in proportion to the logarithm of the width alone
    assert steps < 150 + 20 * math.log2(100 / float(width))


@pytest.mark.parametrize(
    "torque",
    cases([
        "tanh((t-5)/0.001)", "erf((t-5)/0.001)", "atan((t-5)/0.001)", "sigmoid(100*(sin(t)-0.5))",
        "cos(t)^64", "(2+cos(t))^-64", "exp(-50*cos(t)^2)", "exp(-1000*sin(t/7)^2)",
        "1/(1+((t-50)/1e-3)^2)^4", "(t/100)^40",
    ], ["exp(-1000*sin(t/7)^2)"]),
)  # fmt: skip
def test_switches_and_combs(torque: str, runs: Path) -> None:
    """Against quadrature in pieces."""
    functions = {name: getattr(math, name) for name in ["sin", "cos", "exp", "erf", "tanh", "atan", "cosh"]}

    def value(t: float) -> float:
        sigmoid = lambda x: 0.5 * (1 + math.tanh(x / 2))  # noqa: E731
        return float(eval(torque.replace("^", "**"), functions | {"t": t, "sigmoid": sigmoid}))

    near = (c + s * 2.0**-k for c in (5, 50) for s in (-1, 1) for k in range(14))
    pieces = sorted({*np.linspace(0, 100, 401), *near})
    expected = math.fsum(quad(value, a, b, epsabs=1e-15)[0] for a, b in pairwise(pieces))
    run = spun(torque, runs)
    gained = 2 * (run.dataset["angular_velocity"].values[-1, 2] - 0.5)
    blur = 1e3 * 50 * EPS  # of t, over the shortest width
    assert gained == pytest.approx(expected, rel=blur + 50 * EPS * math.sqrt(run.summary["cost"]["steps"]))


def test_an_event_on_a_narrow_function_of_time(runs: Path) -> None:
    """Both crossings of half its height, at t0 -+ w sqrt(ln 2)."""
    event = '[[events]]\nname = "peak"\nexpression = "exp(-((t-50)/w)^2) - 1/2"\n'
    run = spun("0.001*sin(t)", runs, width="1e-4", more=event)
    found = run.dataset["peak_time"].values
    reach = 1e-4 * math.sqrt(math.log(2))
    assert found == pytest.approx([50 - reach, 50 + reach], abs=20 * 50 * EPS)


@pytest.mark.parametrize(
    ("speed", "record", "carried"),
    [
        ("7668.6", "", {"work"}),  # a circle at 400 km
        pytest.param("7668.6", 'record = ["quaternion"]', set(), marks=pytest.mark.slow),
        ("8500", 'record = ["quaternion"]', {"pace"}),  # it rises by 4,600 km
        pytest.param(
            "7668.6", 'record = ["quaternion"]\n[limits]\nmax_drift = 1e-3', {"work"}, marks=pytest.mark.slow
        ),
    ],
)
def test_orbits_through_air_carry_what_they_need(speed: str, record: str, carried: set[str]) -> None:
    """And the summary says what isn't monitored."""
    text = config(
        "principal_moments = [1, 2, 3]\nmass = 4\n[[body.surfaces]]\nradius = 0.2",
        f"position = [6778136, 0, 0]\nvelocity = [1, {speed}, 0]\nangular_velocity = [0.01, 0.02, 0.03]",
        [
            'kind = "central_gravity"\ngravitational_parameter = 3.986004418e14\nradius = 6378136',
            'kind = "drag"\ndensity = 4e-12\naltitude = "400 km"\nscale_height = "60 km"',
        ],
        "end = 60\nsamples = 2",
        output=record,
    )
    run = run_text(text)
    assert {"work", "pace"} & set(run.summary["states"]) == carried
    assert ("energy_balance" in run.summary["invariants"]) == ("work" in carried)
    assert list(run.summary["unwatched"]) == ([] if "work" in carried else ["energy_balance"])
