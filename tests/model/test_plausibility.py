"""Values that are allowed but implausible are warned of in the right words, and nothing else is."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from documented_blocks import blocks_of

import rigidsim
from experiments.coverage.families import coverage_scene
from experiments.random_scenes import random_scene
from rigidsim import parse
from rigidsim.scene.cautions import Caution
from rigidsim.scene.scene import build_scene
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.session.understood import cautions_of

ROOT = Path(__file__).parents[2]
EARTH = 'gravitational_parameter = "3.986004418e14 m^3/s^2"\n'
SUN = "gravitational_parameter = 1.32712440018e20\n"
MOON = 'semi_major_axis = "384400 km", eccentricity = 0.0549, inclination = "5.145 deg"'
MONTHS = 'node_rate = "-19.34 deg/yr", periapsis_rate = "60.0 deg/yr"'


def scene(loads: str, initial: str = "angular_velocity = [0, 0, 1e-3]", moments: str = "1, 2, 2.5") -> str:
    return (
        f'name = "p"\nbody = {{principal_moments = [{moments}], mass = 100}}\n[initial]\n{initial}\n'
        f"[time]\nend = 1000\nsamples = 3\n{loads}"
    )


def gradient(keys: str) -> str:
    return f'[[loads]]\nkind = "gravity_gradient"\n{keys}'


def orbit(keys: str, source: str = EARTH) -> str:
    return gradient(f"{source}orbit = {{{keys}}}")


def flight(place: str, velocity: str) -> str:
    initial = f"angular_velocity = [0, 0, 1e-3]\nposition = {place}\nvelocity = {velocity}"
    return scene(f'[[loads]]\nkind = "central_gravity"\n{EARTH}', initial)


def gravity(acceleration: str) -> str:
    start = "angular_velocity = [0, 0, 1]\nposition = [0, 0, 0]"
    return scene(f'[[loads]]\nkind = "uniform_gravity"\nacceleration = {acceleration}', start)


def torque(*components: str) -> str:
    return scene(f'[[loads]]\nkind = "torque"\ncomponents = {list(components)}')


def month(pace: str, asymmetry: float, turn: float = 27.321661) -> str:
    """The Moon, with an equator of any shape: a turn takes a sidereal month, or so many days."""
    start = f'angular_velocity = [0, 0, "{2 * math.pi / turn!r} rad/day"]'
    moments = f"1, {1 + asymmetry!r}, 1.0006"
    return scene(orbit(f"{MOON}, {MONTHS}, {pace}"), start, moments)


def warned(text: str) -> list[Caution]:
    return cautions_of(build_scene(parse(text)))


IMPLAUSIBLE = {
    "km for m": (
        scene(orbit("semi_major_axis = 6950")),
        "length_without_unit",
        "orbit.semi_major_axis: given 6950 without a unit, which is taken as m: 6950 m "
        'from the centre of the Earth, below its surface at 6378 km; write "6950 km"',
    ),
    "km^3/s^2": (
        scene(orbit('semi_major_axis = "6950 km"', "gravitational_parameter = 398600.4418\n")),
        "length_without_unit",
        'while the Earth\'s is 398600 km^3/s^2; write "398600.4418 km^3/s^2" if',
    ),
    "a velocity in km/s": (
        flight('["7000 km", 0, 0]', "[0, 7.5, 0]"),
        "length_without_unit",
        'a circular orbit there has 7546 m/s; write "7.5 km/s" if',
    ),
    "an air's altitude in km": (
        flight('["6800 km", 0, 0]', '[0, "7.6 km/s", 0]').replace(
            "mass = 100", "mass = 100, surfaces = [{radius = 1}]"
        )
        + 'radius = "6378 km"\n[[loads]]\nkind = "drag"\ndensity = 1e-12\naltitude = 400\n'
        "scale_height = 60\n",
        "length_without_unit",
        "[[loads]] number 2 altitude: given 400 without a unit, which is taken as m, while the body starts "
        '422 km above the surface; write "400 km" if',
    ),
    "an altitude": (
        scene(orbit('semi_major_axis = "550 km"')),
        "below_surface",
        "550 km from the centre of the Earth, below its surface at 6378 km; to an altitude, add the radius",
    ),
    "a period": (
        scene(orbit('semi_major_axis = "7000 km", period = "45 min"')),
        "period_contradicts",
        "orbit.period: a turn takes 45 min, while by Kepler's third law with this "
        "gravitational_parameter an orbit of 7000 km takes 97.14 min",
    ),
    "gravity upwards": (
        gravity("[0, 0, 9.81]"),
        "gravity_upwards",
        "write [0, 0, -9.81] for a fall down along -Z",
    ),
    "sine of degrees": (
        torque("sin(30)", "0", "2*cos(t)"),
        "angle_without_unit",
        "components[0]: given sin(30), whose argument is taken as radians: 1718.87 "
        "deg; write sin(30 deg) if degrees are meant, sin(30 rad) if not",
    ),
    "a tilt in degrees": (
        scene("", "angular_velocity = [0, 5, 0]\neuler_angles = [0, 5, 0]"),
        "angle_without_unit",
        "euler_angles: given 5 without a unit, which is taken as radians: 286.479 deg",
    ),
    "a spin in deg/s": (
        scene(orbit('semi_major_axis = "7000 km"'), "angular_velocity = [0, 0, 0.0618]"),
        "angle_without_unit",
        '0.0617653 deg/s; write "0.0618 deg/s" if',
    ),
    "a sidereal month as the anomalistic one": (
        month('period = "27.321661 day"', 5e-6),
        "near_resonance",
        "a turn takes 27.321661 d, 0.84 % slower than the 1:1 resonance with the orbit of "
        "[[loads]] number 1 (27.092767 d), which holds 0.38 %; the mean anomaly returns after 27.321661 d, "
        "the mean longitude after 27.092767 d: period is anomalistic; give sidereal_period if a sidereal",
    ),
}


@pytest.mark.parametrize(("text", "code", "words"), IMPLAUSIBLE.values(), ids=IMPLAUSIBLE)
def test_it_is_warned_of_once_in_the_right_words(text: str, code: str, words: str) -> None:
    (caution,) = warned(text)
    assert caution.code.value == code
    assert words in caution.text


PLAUSIBLE = {
    "km said": scene(orbit('semi_major_axis = "6950 km"', 'gravitational_parameter = "398600 km^3/s^2"\n')),
    "a small body": scene(orbit("semi_major_axis = 6950", 'gravitational_parameter = "398600 m^3/s^2"\n')),
    "a month": scene(orbit(f'{MOON}, {MONTHS}, sidereal_period = "27.321661 day"')),
    "an anomalistic month": scene(orbit(f'{MOON}, {MONTHS}, period = "27.55455 day"')),
    "the Moon about the Earth": scene(
        orbit(f'{MOON}, period = "27.321661 day"', "gravitational_parameter = 4.9028e12\n")
    ).replace("mass = 100", "mass = 5.9722e24"),
    "a flight": flight('["7000 km", 0, 0]', '[0, "7.5 km/s", 0]'),
    "a fall": flight('["7000 km", 0, 0]', "[0, 0, 0]"),
    "gravity down": gravity("[0, 0, -9.81]"),
    "gravity upwards elsewhere": gravity("[0, 0, 3.71]"),
    "radians": torque("sin(3)", "cos(t + 30)", "sin(30*t)"),
    "locked": month('sidereal_period = "27.321661 day"', 5e-6),
    "no resonance to hold it": month('period = "27.321661 day"', 0.0),
    "a tumbling moon": month('period = "27.321661 day"', 5e-6).replace(
        "[0, 0, ", '["0.1 rad/day", "0.2 rad/day", '
    ),
}


@pytest.mark.parametrize("text", PLAUSIBLE.values(), ids=PLAUSIBLE)
def test_no_false_alarm(text: str) -> None:
    assert warned(text) == []


def test_what_is_ready_to_run_raises_no_alarm() -> None:
    """Every ready config and template, and every whole config in the documentation."""
    found = []
    for path in sorted((ROOT / "configs").rglob("*.toml")):
        found.append((path.name, rigidsim.load(path)))
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        for block in blocks_of(page):
            if block.language == "toml" and block.mark.startswith("file: ") and "table =" not in block.text:
                found.append((f"{page.name}:{block.line}", parse(block.text)))
    for name, experiment in found:
        whole = experiment if experiment.config.sweep is None else Sweep.of(experiment).worked_out(0)
        assert cautions_of(build_scene(whole)) == [], name
    assert len(found) > 40


def test_random_scenes_raise_no_alarm() -> None:
    for number in range(12):
        for text in (random_scene(number, seed=25).text, coverage_scene(number, seed=25).text):
            assert warned(text) == [], number
