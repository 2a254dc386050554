"""Densities and rates by expressions that are, or become, negative, against the zeros of closed forms."""

import random

import numpy as np
import pytest
from scipy.optimize import brentq
from support import config, run_text, seeds, unoptimised_code

import rigidsim
from rigidsim.solve.problem import prepare

FLYING = 'position = ["7000 km", 0, 0]\nvelocity = [0, 7546, 0]\nangular_velocity = [0, 0, 0.01]'
EARTH = 'kind = "central_gravity"\ngravitational_parameter = 3.986004418e14\nradius = "6378 km"'
SURFACE = "principal_moments = [1, 2, 2.5]\nmass = 10\n[[body.surfaces]]\nradius = 1"
SHARE = 2.0**-16  # of its size, by which a quantity may be negative


def scene(kind: str, law: str, end: float) -> str:
    if kind == "drag":
        loads = [EARTH, f'kind = "drag"\ndensity = "{law}"']
        return config(body=SURFACE, initial=FLYING, loads=loads, time=f"end = {end}\nsamples = 3")
    load = f'kind = "mass_loss"\nexit_point = [0, 0, 1]\nrate = "{law}"'
    return config(loads=load, time=f"end = {end}\nsamples = 3")


def drawn(draw: random.Random):
    """A law that becomes negative, as text and as a function, and one that doesn't."""
    a, T = draw.choice([1e-12, 1e-9, 1e-3, 2.5]), round(draw.uniform(3, 40), 2)
    falling = [
        (f"{a}*(1 - t/{T})", lambda t: a * (1 - t / T)),
        (f"{a}*cos(t/{T})", lambda t: a * np.cos(t / T)),
        (f"{a}*(2 - exp(t/{T}))", lambda t: a * (2 - np.exp(t / T))),
        (f"{a}*(1 - (t/{T})^2)", lambda t: a * (1 - (t / T) ** 2)),
        (f"{a}*(0.5 - tanh(t/{T}))", lambda t: a * (0.5 - np.tanh(t / T))),
        (f"{a}*exp(-t/{T})*cos(t/{T})", lambda t: a * np.exp(-t / T) * np.cos(t / T)),
        (f"{a}*min(1, 2 - t/{T})", lambda t: a * min(1, 2 - t / T)),
        (f"{a}*(1 - step(t - {T})*(t - {T}))", lambda t: a * (1 - (t > T) * (t - T))),
    ]
    staying = [
        f"{a}*exp(-t/{T})", f"{a}*(1 + cos(t/{T}))", f"{a}*max(1 - t/{T}, 0)", f"{a}*(t/{T} - 1)^2",
        f"{a}*(1 - pulse(t, {T}, {T + 1}))", f"{a}*abs(1 - t/{T})", f"{a}*t/{T}",
    ]  # fmt: skip
    return *draw.choice(falling), draw.choice(staying), T


@pytest.mark.parametrize("seed", seeds(1, 55))
def test_what_becomes_negative_ends_the_run(seed: int) -> None:
    draw = random.Random(seed)
    kind = draw.choice(["drag", "mass_loss"])
    law, function, staying, T = drawn(draw)
    end = brentq(lambda t: function(t) + SHARE * function(0), 0, 3 * T)
    with unoptimised_code():
        run = run_text(scene(kind, law, 3 * T))
        fine = run_text(scene(kind, staying, 3 * T))
    assert run.status == "stopped: impossible body"
    key = {"drag": "number 2 density", "mass_loss": "number 1 rate"}[kind]
    assert f"[[loads]] {key} is negative" in run.summary["message"]
    assert run.summary["time_reached"] == pytest.approx(end, rel=1e-9)
    assert fine.status == "finished"
    with pytest.raises(rigidsim.ConfigError, match="at the start; at least 0 is allowed"):
        prepare(rigidsim.parse(scene(kind, f"-1*({law})", 3 * T)))


@pytest.mark.parametrize("seed", seeds(1, 50))
def test_where_a_law_stops_being_finite_is_named(seed: int) -> None:
    draw = random.Random(seed)
    T = round(draw.uniform(0.1, 4), 3)
    law = draw.choice([
        f"1e-9*log({T} + 1 - t)*0 + log({T} - t)", f"sqrt({T} - t)", f"asin(t/{T})", f"acos(t/{T})",
        f"log(1 - t/{T})", f"sqrt({T}^2 - t^2)", f"1 + log({T * T} - t*t)",
    ])  # fmt: skip
    kind = draw.choice(["drag", "torque", "state"])
    if kind == "drag":
        text = scene(kind, law, 100 * T)
    elif kind == "torque":
        load = f'kind = "torque"\ncomponents = ["{law}", "0", "0"]'
        text = config(loads=load, time=f"end = {100 * T}\nsamples = 3")
    else:
        more = f'[[states]]\nname = "u"\ninitial = 0\nderivative = "{law}"'
        text = config(time=f"end = {100 * T}\nsamples = 3", more=more)
    with pytest.raises(rigidsim.ConfigError) as caught:
        prepare(rigidsim.parse(text))
    said = str(caught.value).partition("no finite value after t = ")[2].partition(" s,")[0]
    assert float(said) == pytest.approx(T, rel=1e-7)  # shown to 8 digits


BELOW_ZERO = {
    "[body]": ("mass = -10", "radius = -1"),
    "drag": (
        "density = -1e-12",
        'density = "-1e-12 kg/m^3"',
        "scale_height = -5\naltitude = 4e5\ndensity = 1",
    ),
    "mass_loss": ('rate = "-1"', 'rate = "1"\nexit_radius = -1'),
    "viscous_torque": ("coefficients = [-1, 0, 0]",),
}


@pytest.mark.parametrize(("place", "lines"), [(k, x) for k, every in BELOW_ZERO.items() for x in every])
def test_numbers_below_zero_are_refused(place: str, lines: str) -> None:
    if place == "[body]":
        text = config(body=f"principal_moments = [1, 2, 2.5]\n{lines.split(chr(10))[0]}")
        text = text if "mass" in lines else config(body=SURFACE.replace("radius = 1", lines), initial=FLYING)
    elif place == "drag":
        text = config(body=SURFACE, initial=FLYING, loads=[EARTH, f'kind = "drag"\n{lines}'])
    else:
        point = "" if place == "viscous_torque" else "\nexit_point = [0, 0, 1]"
        text = config(loads=f'kind = "{place}"\n{lines}{point}')
    with pytest.raises(rigidsim.ConfigError, match=r"allowed|above|at least 0"):
        prepare(rigidsim.parse(text))
