"""Numbers in the comments of configs/ are those of the scenes below them."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from support import CONFIGS

import rigidsim
from rigidsim.scene.scene import Scene, build_scene

SOLAR = 86400 / 86164.0905  # sidereal days in a mean solar one


def top(scene: Scene) -> tuple[float, float, float, float]:
    """A, C, M g l and the spin of a heavy symmetric top."""
    a, c = (float(scene.body.principal_moments[i]) for i in (0, 2))
    assert scene.gravity is not None
    assert scene.body.mass is not None
    pull = float(scene.body.mass * scene.body.center_of_mass[2] * -scene.gravity[2])
    return a, c, pull, float(scene.angular_velocity[2])


def threshold(scene: Scene) -> list[str]:
    a, c, pull, _ = top(scene)
    return [f"{2 * math.sqrt(a * pull) / c:.2f} rad/s here"]


def falling(scene: Scene) -> list[str]:
    a, c, pull, spin = top(scene)
    return [*threshold(scene), f"= {math.sqrt(pull / a - (c * spin / (2 * a)) ** 2):.2f} per second"]


def fast(scene: Scene) -> list[str]:
    a, c, pull, spin = top(scene)
    return [f"{pull / (c * spin):.3f} rad/s", f"{c / a * spin:.0f} rad/s"]


def regular(scene: Scene) -> list[str]:
    a, c, pull, spin = top(scene)
    needed = (a * 2**2 * math.cos(math.pi / 3) + pull) / (2 * c)  # of A p^2 cos - C w3 p + M g l, p = 2 rad/s
    assert spin == pytest.approx(needed, rel=1e-12)
    return [f"w3 = {needed:.3f} rad/s"]


def nutation(scene: Scene) -> float:
    """Sidereal days of a free nutation of the Earth."""
    a, c = (float(scene.body.principal_moments[i]) for i in (0, 2))
    return a / (c - a)


def symmetric(scene: Scene) -> list[str]:
    a, c = (float(scene.body.principal_moments[i]) for i in (0, 2))
    return [f"= {(c - a) / a * float(scene.angular_velocity[2]):.1f} rad/s"]


def all_in_the_wheel(scene: Scene) -> float:
    """Rate of the wheel (rpm) with the body's momentum."""
    (wheel,) = scene.tabled["rotors"]
    momentum = float(scene.body.principal_moments[2] * scene.angular_velocity[2])
    return momentum / wheel.pictured()["moment"] * 30 / math.pi


def steadying_rate(scene: Scene) -> float:
    """(C - B) w over the wheel's moment, rad/s."""
    (wheel,) = scene.tabled["rotors"]
    _, b, c = (float(x) for x in scene.body.principal_moments)
    return (c - b) * float(scene.angular_velocity[1]) / wheel.pictured()["moment"]


STATED: dict[str, Callable[[Scene], list[str]]] = {
    "earth_free_nutation": lambda s: [f"{nutation(s):.3f} sidereal", f"{nutation(s) / SOLAR:.2f} mean solar"],
    "earth_free_nutation_axes": lambda s: [f"{nutation(s):.1f} sid", f"{nutation(s) / SOLAR:.1f} mean solar"],
    "free_symmetric_top": symmetric,
    "heavy_top_fast": fast,
    "heavy_top_regular_precession": regular,
    "heavy_top_sleeping_stable": threshold,
    "heavy_top_sleeping_unstable": falling,
    "dual_spin_turn": lambda s: [f"{all_in_the_wheel(s):.0f} rpm"],
    "intermediate_axis_with_wheel": lambda s: [f"or {steadying_rate(s):.0f} rad/s"],
    "intermediate_axis": lambda s: [", ".join(f"{float(m):g}" for m in s.body.principal_moments)],
    "tumbling_planet": lambda s: [f"{float(s.body.principal_moments[2]):.0e} kg m^2".replace("+", "")],
}


def given(name: str) -> tuple[str, str]:
    """A config's text, and the same without line breaks in its comments."""
    (path,) = (path for path in CONFIGS if path.stem == name)
    text = path.read_text(encoding="utf-8")
    return text, text.replace("\n# ", " ")


@pytest.mark.parametrize("name", STATED)
def test_what_a_scene_gives_at_once(name: str) -> None:
    text, comments = given(name)
    for phrase in STATED[name](build_scene(rigidsim.parse(text))):
        assert phrase in comments


@pytest.mark.slow
def test_how_far_the_satellite_is_braked(runs: Path) -> None:
    text, comments = given("detumbling_cubesat")
    changes = ["output.timeline=false", "output.estimate=false"]
    run = rigidsim.run(rigidsim.parse(text, overrides=changes), out=runs)
    with run.dataset as dataset:
        momentum, energy = (
            float(dataset[name][-1] / dataset[name][0]) for name in ("angular_momentum_norm", "energy")
        )
    assert f"momentum falls to {100 * momentum:.0f} % and the energy to {100 * energy:.0f} %" in comments
    assert f"takes {round(run.summary['cost']['steps'], -3):,} steps" in comments
