"""What a stranger may write about real bodies: refused beforehand with good words, or told as doubtful."""

import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import de421
import numpy as np
import pytest
from kernel_scenes import moon, satellite, system
from support import config
from test_field_files import text as field_scene

from rigidsim import ConfigError, load, parse
from rigidsim.scene.scene import build_scene
from rigidsim.session.understood import cautions_of
from rigidsim.solve.problem import prepare

FIGURE = 'figure = {J2 = %s, radius = "%s", pole = %s}'


def orbit(body: str = "", load: str = "") -> str:
    return config(
        f"principal_moments = [8.79e34, 8.7920e34, 8.7955e34]\n{body}",
        "angular_velocity = [1e-8, -2e-8, 2.6617e-6]",
        'kind = "gravity_gradient"\ngravitational_parameter = "3.986004418e14 m^3/s^2"\n'
        f'orbit = {{semi_major_axis = "384400 km"}}\n{load}',
        'epoch = "2000-01-01T12:00:00 TDB"\nend = "10 day"\nsamples = 3',
        more='[frame]\naxes = "ICRF"',
    )


def lumps(coefficients: str, radius: str = "1.7e6") -> str:
    return field_scene(f"{{radius = {radius}, {coefficients}}}", degree=3)


REFUSED = {
    "a module": (moon("os"), "which is no installed package of an ephemeris"),
    "no kernel": (moon().replace('[ephemeris]\nkernel = "de421"\n', ""), "neither [[bodies]] nor an [ephem"),
    "with the body itself": (moon(sources=("earth_moon_barycenter",)), 'contains "moon"'),
    "bodies, a part and the whole": (
        system(("earth", "moon", "earth_moon_barycenter")),
        'whose mass contains "earth" and "moon"; remove one of them',
    ),
    "a coefficient that no mass has": (lumps('C = {"3,0" = 50}'), 'given 50.0 as "3,0" in C (unnormalized)'),
    "a source in the field's radius": (lumps('C = {"3,0" = 1e-6}', "1e9"), "1e+06 km of [body]"),
    "friction without end": (orbit("core = {moment = 1e-3, friction = 1e10}"), "core.friction: given 1e+10"),
    "a pole beyond its theory": (
        orbit(load=FIGURE % (1e-3, "6378 km", '"iau1976"')).replace('"10 day"', '"9000 yr"'),
        "90 centuries from J2000",
    ),
    "the Earth's pole elsewhere": (
        moon().replace('source = "sun"', 'source = "sun"\n' + FIGURE % (1e-7, "7e5 km", '"iau1976"')),
        'figure.pole: given "iau1976", the Earth\'s pole, for the source "sun"',
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_nonsense_is_refused_beforehand(name: str) -> None:
    text, words = REFUSED[name]
    with pytest.raises(ConfigError) as caught:
        prepare(parse(text))
    assert words in str(caught.value)


def test_a_device_is_no_file_of_a_field(tmp_path: Path) -> None:
    """It would be read without end."""
    (tmp_path / "scene.toml").write_text(field_scene('{file = "/dev/zero"}'))
    with pytest.raises(ConfigError, match="which is a folder or a device: /dev/zero"):
        load(tmp_path / "scene.toml")


DOUBTFUL = {
    "an elastic body's radius in km": (
        orbit("mass = 7.3e22\nelasticity = {love_number = 0.02, radius = 1738}"),
        "length_without_unit",
        "[body] elasticity radius: given 1738 without a unit",
    ),
    "km^3/s^2": (moon(sources={"earth": 398600.44}), "length_without_unit", 'write "398600.44 km^3/s^2"'),
    "another's": (moon(sources={"earth": 1.327124e20}), "strength_contradicts", "which is the Sun's, for"),
    "no host's": (satellite(("moon", "sun")), "host_without_gravity", 'given "earth", whose own gravity no'),
    "in the Sun": (satellite().replace('host = "earth"\n', ""), "below_surface", "centre of the Sun"),
}


@pytest.mark.parametrize("name", DOUBTFUL)
def test_doubtful_numbers_are_told(name: str) -> None:
    text, code, words = DOUBTFUL[name]
    [caution] = cautions_of(build_scene(parse(text)))
    assert caution.code.value == code
    assert words in caution.text


def test_sound_scenes_are_told_nothing() -> None:
    assert [cautions_of(build_scene(parse(x))) for x in (moon(), satellite(), system())] == [[], [], []]


# --- packages ---------------------------------------------------------------------------------------------

PACKAGE = Path(str(de421.__file__)).parent


def package(folder: Path, name: str, damage: Callable[[Path], object]) -> None:
    """A copy of de421 of some name, damaged."""
    place = folder / name
    place.mkdir()
    for file in PACKAGE.glob("*.*"):
        shutil.copy(file, place)
    damage(place)


def constant(key: str, value: float) -> Callable[[Path], None]:
    def change(place: Path) -> None:
        found = np.load(place / "constants.npy")
        found["value"][found["name"] == key.encode()] = value
        np.save(place / "constants.npy", found)

    return change


def rewritten(file: str, change: Callable[[bytes], bytes]) -> Callable[[Path], object]:
    return lambda place: (place / file).write_bytes(change((place / file).read_bytes()))


DAMAGED = {
    "header": (rewritten("constants.npy", lambda x: x[:20] + b"z" + x[21:]), "constants.npy is damaged"),
    "cut": (rewritten("jpl-moon.npy", lambda x: x[:-8]), "jpl-moon.npy is damaged or truncated"),
    "span": (constant("jalpha", 2524624.5), "its span is empty"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_packages_are_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    damage, words = DAMAGED[name]
    own = f"kernel_{list(DAMAGED).index(name)}"  # an own name: found modules are remembered
    package(tmp_path, own, damage)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ConfigError) as caught:
        prepare(parse(moon(own)))
    assert words in str(caught.value)
    assert f"install {own} again" in str(caught.value)


def test_no_code_of_a_package_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package(
        tmp_path, "kernel_with_code", lambda place: (place / "__init__.py").write_text("raise SystemExit(3)")
    )
    monkeypatch.syspath_prepend(tmp_path)
    build_scene(parse(moon("kernel_with_code", time='end = "1 day"')))
    assert "kernel_with_code" not in sys.modules
