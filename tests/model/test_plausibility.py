"""Values that are allowed but implausible are warned of in the right words, and nothing else is."""

import math
from pathlib import Path

import numpy as np
import pytest
from documented_blocks import blocks_of

import rigidsim
from experiments.coverage.families import coverage_scene
from experiments.random_scenes import random_scene
from rigidsim import parse
from rigidsim.scene.cautions import Caution
from rigidsim.scene.scene import build_scene
from rigidsim.scene.sweep import Sweep
from rigidsim.session.understood import cautions_of

ROOT = Path(__file__).parents[2]
EARTH = 'gravitational_parameter = "3.986004418e14 m^3/s^2"\n'
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


def month(pace: str, asymmetry: float) -> str:
    """The Moon, with an equator of any shape: a turn takes a sidereal month."""
    start = f'angular_velocity = [0, 0, "{2 * math.pi / 27.321661!r} rad/day"]'
    moments = f"1, {1 + asymmetry!r}, 1.0006"
    return scene(orbit(f"{MOON}, {MONTHS}, {pace}"), start, moments)


def turned(angles: str, keys: str = "inclination = 1") -> str:
    """About an orbit of the Earth, from Euler angles."""
    start = f"angular_velocity = [40, 60, 1000]\neuler_angles = {angles}"
    return scene(orbit(f"semi_major_axis = 7e6, {keys}"), start)


def warned(text: str) -> list[Caution]:
    return cautions_of(build_scene(parse(text)))


IMPLAUSIBLE = {
    "km for m": (
        scene(orbit("semi_major_axis = 6950")),
        "length_without_unit",
        "orbit.semi_major_axis: given 6950 without a unit, which is taken as m: 6950 m "
        'from the centre of the Earth, below its surface at 6378 km; write "6950 km"',
    ),
    "a velocity in km/s": (
        flight('["7000 km", 0, 0]', "[0, 7.5, 0]"),
        "length_without_unit",
        'a circular orbit there has 7546 m/s; write "7.5 km/s" if',
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
    "angles in degrees": (
        turned("[40, 60, 30]"),
        "angle_without_unit",
        "[initial] euler_angles: given 40, 60, 30 without a unit, which is taken as radians: "
        '2291.83, 3437.75, 1718.87 deg; write "40 deg" if degrees are meant, "40 rad" if not',
    ),
    "one angle": (turned('[0, "-23.5", 0]'), "angle_without_unit", "euler_angles: given -23.5 without"),
    "an inclination": (turned("[0, 1, 0]", "inclination = 51.6"), "angle_without_unit", "orbit.inclination"),
    "an anomaly": (turned("[0, 1, 0]", 'mean_anomaly = "100"'), "angle_without_unit", "orbit.mean_anomaly"),
    "an end in the unit of times": (
        turned("[0, 1, 0]").replace("end = 1000", 'end = 30\nunit = "day"'),
        "time_without_unit",
        '[time] end: given 30 without a unit, which is taken as seconds: 0.000347 day; write "30 day" if',
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
    "a month": scene(orbit(f'{MOON}, {MONTHS}, sidereal_period = "27.321661 day"')),
    "the Moon about the Earth": scene(
        orbit(f'{MOON}, period = "27.321661 day"', "gravitational_parameter = 4.9028e12\n")
    ).replace("mass = 100", "mass = 5.9722e24"),
    "a fall": flight('["7000 km", 0, 0]', "[0, 0, 0]"),
    "gravity upwards elsewhere": gravity("[0, 0, 3.71]"),
    "turns in radians": turned("[6.28, -6.28, 0]"),
    "angles said": turned('["40 deg", "-10*pi/3", "20 pi"]'),
    "an end said": turned("[0, 1, 0]").replace("end = 1000", 'end = "30 s"\nunit = "day"'),
    "radians": torque("sin(3)", "cos(t + 30)", "sin(30*t)"),
    "a tumbling moon": month('period = "27.321661 day"', 5e-6).replace(
        "[0, 0, ", '["0.1 rad/day", "0.2 rad/day", '
    ),
}


@pytest.mark.parametrize("text", PLAUSIBLE.values(), ids=PLAUSIBLE)
def test_no_false_alarm(text: str) -> None:
    assert warned(text) == []


@pytest.mark.slow
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


def librates(p: np.ndarray, e: float, asymmetry: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Whether theta - p M stays near where it starts over 150 orbits, by Runge's and Kutta's method for the
    planar motion theta'' = -(3/2) (B - A)/C (a/r)^3 sin 2(theta - f), with n = 1, from the periapsis.
    """
    steps = 96
    mean = np.arange(2 * steps) * math.pi / steps
    eccentric = mean.copy()
    for _ in range(60):
        eccentric -= (eccentric - e * np.sin(eccentric) - mean) / (1 - e * np.cos(eccentric))
    true = 2 * np.arctan2(math.sqrt(1 + e) * np.sin(eccentric / 2), math.sqrt(1 - e) * np.cos(eccentric / 2))
    cubes, step, far = (1 - e * np.cos(eccentric)) ** -3.0, 2 * math.pi / steps, np.zeros(len(p))

    def slope(y: np.ndarray, half: int) -> np.ndarray:
        at = half % (2 * steps)
        return np.array([y[1], -1.5 * asymmetry * cubes[at] * np.sin(2 * (y[0] - true[at]))])

    y = np.array([0 * spin, spin])
    for k in range(150 * steps):
        k1 = slope(y, 2 * k)
        k2 = slope(y + step / 2 * k1, 2 * k + 1)
        k3 = slope(y + step / 2 * k2, 2 * k + 1)
        k4 = slope(y + step * k3, 2 * k + 2)
        y = y + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        far = np.maximum(far, np.abs(y[0] - p * step * (k + 1)))
    return far < math.pi / 2


def test_a_spin_is_outside_its_resonance_where_the_planar_motion_circulates() -> None:
    generator, e = np.random.default_rng(2025), 0.15
    p = np.array([1.0, 1.5] * 3)
    strength = np.where(p == 1, 1 - 2.5 * e**2, 3.5 * e - 7.7 * e**3)
    width = generator.uniform(4e-3, 6e-3, 6)
    asymmetry = width**2 / (3 * strength)
    factor = np.tile([0.75, 1.3], 3)[np.argsort(generator.random(6))]
    spin = p + generator.choice([-1, 1], 6) * factor * width
    held = librates(p, e, asymmetry, spin)
    assert (held == (factor < 1)).all()
    motion = math.sqrt(3.986004418e14 / 8e6**3)
    for number in range(6):
        text = scene(
            orbit(f'semi_major_axis = "{8e3 / (1 - e)!r} km", eccentricity = {e}'),
            f"angular_velocity = [0, 0, {float(spin[number]) * motion * (1 - e) ** 1.5!r}]",
            f"1, {1 + float(asymmetry[number]) * 1.2!r}, 1.2",
        )
        assert [c.code.value for c in warned(text)] == ["near_resonance"] * (not held[number]), number
