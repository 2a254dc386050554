"""Values that are allowed but implausible are warned of in the right words, and nothing else is."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from documented_blocks import blocks_of
from scipy.optimize import brentq

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


def dipole(keys: str) -> str:
    moments = "moment = [0, 0, 1]\nsource_moment = [0, 0, 8e22]"
    return scene(f'[[loads]]\nkind = "magnetic_dipole"\n{moments}\norbit = {{{keys}}}')


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
    "au": (scene(orbit("semi_major_axis = 1.5237", SUN)), "length_without_unit", 'write "1.5237 au" if'),
    "a start in km": (
        flight("[7000, 0, 0]", "[0, 7.5, 0]"),
        "length_without_unit",
        "[initial] position: given 7000, 0, 0 without",
    ),
    "a velocity in km/s": (
        flight('["7000 km", 0, 0]', "[0, 7.5, 0]"),
        "length_without_unit",
        'a circular orbit there has 7546 m/s; write "7.5 km/s" if',
    ),
    "a radius in km": (
        flight('["7000 km", 0, 0]', '[0, "7.5 km/s", 0]') + "radius = 6378.137\n",
        "length_without_unit",
        "[[loads]] number 1 radius: given 6378.137 without a unit, which is taken as m, while the radius of "
        'the Earth is 6378 km; write "6378.137 km" if',
    ),
    "a figure's radius in km": (
        flight('["7000 km", 0, 0]', '[0, "7.5 km/s", 0]')
        + "figure = {J2 = 1e-3, radius = 6378, pole = [0, 0, 1]}\n",
        "length_without_unit",
        "[[loads]] number 1 figure.radius: given 6378 without a unit",
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
    "a longitude's rate": (
        scene(orbit('semi_major_axis = "7000 km", longitude_rate = "1 deg/s"')),
        "period_contradicts",
        "longitude_rate",
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
    "in the units of nobody": (
        scene(
            orbit(
                "semi_major_axis = 1, eccentricity = 0.1, inclination = 0.1, period = 6.25, "
                "periapsis_rate = 5e-3",
                "gravitational_parameter = 1\n",
            ),
            "angular_velocity = [0, 0, 1.0053096491487339]",
            "1, 1.000002, 1.1",
        ),
        "near_resonance",
        "0.49 % slower than the 1:1",
    ),
}


@pytest.mark.parametrize(("text", "code", "words"), IMPLAUSIBLE.values(), ids=IMPLAUSIBLE)
def test_it_is_warned_of_once_in_the_right_words(text: str, code: str, words: str) -> None:
    (caution,) = warned(text)
    assert caution.code.value == code
    assert words in caution.text


PLAUSIBLE = {
    "km said": scene(orbit('semi_major_axis = "6950 km"', 'gravitational_parameter = "398600 km^3/s^2"\n')),
    "m said": scene(orbit('semi_major_axis = "384400 m"', "gravitational_parameter = 5e10\n")),
    "a small body": scene(orbit("semi_major_axis = 6950", 'gravitational_parameter = "398600 m^3/s^2"\n')),
    "numbers": scene(orbit("semi_major_axis = 1, period = 5", "gravitational_parameter = 1\n")),
    "a month": scene(orbit(f'{MOON}, {MONTHS}, sidereal_period = "27.321661 day"')),
    "an anomalistic month": scene(orbit(f'{MOON}, {MONTHS}, period = "27.55455 day"')),
    "the Moon about the Earth": scene(
        orbit(f'{MOON}, period = "27.321661 day"', "gravitational_parameter = 4.9028e12\n")
    ).replace("mass = 100", "mass = 5.9722e24"),
    "a year": scene(orbit('semi_major_axis = "1 au", period = "365.2596 day"', SUN)),
    "a flight": flight('["7000 km", 0, 0]', '[0, "7.5 km/s", 0]'),
    "a fall": flight('["7000 km", 0, 0]', "[0, 0, 0]"),
    "gravity down": gravity("[0, 0, -9.81]"),
    "gravity upwards elsewhere": gravity("[0, 0, 3.71]"),
    "radians": torque("sin(3)", "cos(t + 30)", "sin(30*t)"),
    "radians said": torque("1 N m * sin(30 rad)", "1 N m * cos(30 deg)", "0"),
    "locked": month('sidereal_period = "27.321661 day"', 5e-6),
    "no resonance to hold it": month('period = "27.321661 day"', 0.0),
    "a tumbling moon": month('period = "27.321661 day"', 5e-6).replace(
        "[0, 0, ", '["0.1 rad/day", "0.2 rad/day", '
    ),
    "far from it": month('period = "27.321661 day"', 5e-6, 25.0),
}


@pytest.mark.parametrize("text", PLAUSIBLE.values(), ids=PLAUSIBLE)
def test_no_false_alarm(text: str) -> None:
    assert warned(text) == []


@pytest.mark.parametrize("size", ["1e-4000", "1e4000"])
def test_no_number_is_too_small_or_too_large_to_be_told_of(size: str) -> None:
    """Scenes in quadruple precision may have numbers that no double holds."""
    strength = f"gravitational_parameter = {size}\n"
    for text in (
        scene(orbit(f"semi_major_axis = {size}, period = 5")),
        scene(orbit("semi_major_axis = 1, inclination = 0.1, node_rate = 1e-3", strength)),
        scene(gradient(f"{strength}position = [0, 0, {size}]")),
        gravity(f"[0, {size}, -{size}]"),
        torque(size, "0", f"sin({size})"),
        dipole(f"semi_major_axis = {size}, longitude_rate = {size}"),
        flight(f"[{size}, 0, 0]", f"[0, {size}, 0]"),
    ):
        found = build_scene(parse(text))
        assert all(load.told(found) for load in found.given_loads if load.acts())  # type: ignore[attr-defined]
        assert all(caution.text for caution in cautions_of(found))


def ready() -> Iterator[tuple[str, rigidsim.Experiment]]:
    """Every ready config and template, and every whole config in the documentation."""
    for path in sorted((ROOT / "configs").rglob("*.toml")):
        yield path.name, rigidsim.load(path)
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        for block in blocks_of(page):
            if block.language == "toml" and block.mark.startswith("file: ") and "table =" not in block.text:
                yield f"{page.name}:{block.line}", parse(block.text)


def test_what_is_ready_to_run_raises_no_alarm() -> None:
    count = 0
    for name, experiment in ready():
        whole = experiment if experiment.config.sweep is None else Sweep.of(experiment).worked_out(0)
        assert cautions_of(build_scene(whole)) == [], name
        count += 1
    assert count > 40


def alarms(numbers: range) -> list[str]:
    found = []
    for number in numbers:
        for text in (random_scene(number, seed=25).text, coverage_scene(number, seed=25).text):
            found += [f"{number}: {caution.text}" for caution in warned(text)]
    return found


def test_random_scenes_raise_no_alarm() -> None:
    assert alarms(range(12)) == []


@pytest.mark.slow(9)
def test_many_random_scenes_raise_no_alarm() -> None:
    assert alarms(range(12, 300)) == []


# --- where resonances end ------------------------------------------------------------------------------

ORBITS, STEPS = 800, 48  # of integration, and of a step of Runge and Kutta in each orbit


def anomalies(e: float) -> tuple[np.ndarray, np.ndarray]:
    """True anomaly and (a/r)^3 at equal steps of half a time step over one orbit, from periapsis."""
    mean = np.arange(2 * STEPS) * math.pi / STEPS
    eccentric = np.array(
        [brentq(lambda E, m=m: E - e * math.sin(E) - m, m - e - 1e-9, m + e + 1e-9) for m in mean]
    )
    true = 2 * np.arctan2(math.sqrt(1 + e) * np.sin(eccentric / 2), math.sqrt(1 - e) * np.cos(eccentric / 2))
    return true, (1 - e * np.cos(eccentric)) ** -3.0


def librates(p: np.ndarray, e: np.ndarray, asymmetry: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Whether theta - p M stays near where it starts, by Runge's and Kutta's method for the planar motion
    theta'' = -(3/2) (B - A)/C (a/r)^3 sin 2(theta - f), with n = 1 and the periapsis fixed.
    """
    true, cubes = (np.array(x) for x in zip(*map(anomalies, e), strict=True))
    angle = np.where(p == 0.5, math.pi / 2, 0.0)  # H < 0 turns the stable attitude
    rate, step, start = spin.copy(), 2 * math.pi / STEPS, angle.copy()
    far = np.zeros(len(p))

    def pull(theta: np.ndarray, half: int) -> np.ndarray:
        at = half % (2 * STEPS)
        return -1.5 * asymmetry * cubes[:, at] * np.sin(2 * (theta - true[:, at]))

    for k in range(ORBITS * STEPS):
        a1 = pull(angle, 2 * k)
        a2 = pull(angle + step / 2 * rate, 2 * k + 1)
        a3 = pull(angle + step / 2 * (rate + step / 2 * a1), 2 * k + 1)
        a4 = pull(angle + step * (rate + step / 2 * a2), 2 * k + 2)
        angle = angle + step * (rate + step / 6 * (a1 + a2 + a3))
        rate = rate + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        far = np.maximum(far, np.abs(angle - p * step * (k + 1) - start))
    return far < math.pi / 2


@pytest.mark.slow(30)
def test_it_is_told_exactly_where_a_spin_is_outside_its_resonance() -> None:
    """64 random spins inside and outside of their resonances, against the motion itself."""
    generator = np.random.default_rng(2025)
    count, names = 64, {1.0: "1:1", 1.5: "3:2", 0.5: "1:2", 2.0: "2:1"}
    p = np.tile(list(names), count // 4)
    e = generator.uniform(0.1, 0.25, count)
    strength = np.select(
        [p == 1, p == 1.5, p == 0.5], [1 - 2.5 * e**2, 3.5 * e - 7.7 * e**3, 0.5 * e], 8.5 * e**2
    )
    width = generator.uniform(2e-3, 4e-3, count)
    asymmetry = width**2 / (3 * strength)
    sign = generator.choice([-1, 1], count)
    factor = np.where(
        generator.random(count) < 0.5, generator.uniform(0.7, 0.85, count), generator.uniform(1.2, 1.5, count)
    )
    spin = p + sign * factor * width
    held = librates(p, e, asymmetry, spin)
    assert (held == (factor < 1)).all()
    motion = math.sqrt(3.986004418e14 / 8e6**3)
    for i in range(count):
        text = scene(
            orbit(f'semi_major_axis = "{8e3 / (1 - e[i]):.17g} km", eccentricity = {e[i]:.17g}'),
            f"angular_velocity = [0, 0, {spin[i] * motion * (1 - e[i]) ** 1.5:.17g}]",
            f"1, {1 + asymmetry[i] * 1.2:.17g}, 1.2",
        )
        found = warned(text)
        assert [caution.code.value for caution in found] == ["near_resonance"] * (not held[i]), i
        assert all(f"{names[p[i]]} resonance" in caution.text for caution in found)


@pytest.mark.parametrize(
    ("place", "velocity", "words"),
    [
        ("[7000e3, 0, 0]", "[0, 7546, 0]", "on an orbit of 7000 to 7000 km, period 97.14 min; torque up to"),
        ("[7000e3, 0, 0]", "[0, 0, 0]", "on an orbit of 0 to 7000 km, period 34.34 min; torque "),
        ("[7000e3, 0, 0]", "[0, 1, 0]", "on an orbit of 6.147e-05 to 7000 km, period 34.34 min; torque "),
        ("[-50000e3, 8000e3, 0]", "[9000, 0, 0]", "unbound, no nearer than 4697 km; torque up to"),
    ],
)
def test_the_told_orbit_is_that_of_kepler(place: str, velocity: str, words: str) -> None:
    """Pericentres of p/(1 + e) with p = h^2/GM, however near the point, to which estimates don't follow."""
    built = build_scene(parse(flight(place, velocity)))
    said = built.loads[0].told(built)  # type: ignore[attr-defined]
    assert words in said
    assert ("up to" in said) == ("up to" in words)


def test_a_moment_is_told_with_its_numbers_and_its_laws() -> None:
    built = build_scene(
        parse(
            scene(
                '[[loads]]\nkind = "magnetic_dipole"\nmoment = ["-1e5*wx*by", 0, "1.5 A m^2"]\n'
                "field = [0, 0, 3e-5]"
            )
        )
    )
    said = built.loads[0].told(built)  # type: ignore[attr-defined]
    assert (
        "dipole of [-1e5*wx*by, 0, 1.5] A m^2 in a uniform field of 3e-05 T: 1.5 A m^2 at the start" in said
    )
