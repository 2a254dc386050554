"""Averages over the rotation under bodies of a kernel, and under tables: both set states where steps end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support import run_text, same_bits

import rigidsim
from rigidsim import ConfigError

SCENE = """
name = "planet"
[body]
host = "{host}"
principal_moments = [{moments}, 1]
[initial]
euler_angles = {angles}
angular_velocity = [0, 0, {spin}]
[ephemeris]
kernel = "de421"
{loads}
[model]
level = "spin_averaged"
[time]
epoch = "2000-01-01T12:00:00 TDB"
end = "{end}"
samples = 21
[output]
record = ["momentum_axis"]
timeline = false
"""
SOURCE = '[[loads]]\nkind = "gravity_gradient"\nsource = "{}"\n'
EARTH = {
    "host": "earth",
    "moments": '"0.996726", "0.996727"',
    "angles": '[0, "0.1 deg", 0]',
    "spin": 7.292115e-5,
}
MARS = {
    "host": "mars",
    "moments": "0.9946, 0.99465",
    "angles": '["47.68 deg", "37.11 deg", 0]',
    "spin": 7.0882e-5,
}
MOON = {"host": "moon", "moments": "0.99937, 0.9996", "angles": '[0, "22 deg", 0]', "spin": 2.6617e-6}


def scene(body: dict[str, object], *sources: str, end: str = "60 day") -> str:
    return SCENE.format(**body, loads="".join(map(SOURCE.format, sources)), end=end)


@pytest.mark.parametrize(
    "text",
    [
        scene(EARTH, "sun", "moon", end="200 day"),
        pytest.param(scene(MARS, "sun", end="2 yr"), marks=pytest.mark.slow),
    ],
)
def test_both_announced_errors_are_true(text: str) -> None:
    """That of the model beside every rotation, that of the integration beside 80 bits."""
    averaged = run_text(text, estimate=True)
    path = averaged.dataset["momentum_axis"].values

    def apart(*changes: str) -> float:
        other = run_text(text, *changes).dataset["momentum_axis"].values
        return float(np.linalg.norm(path - other, axis=1).max())

    true = apart("model.level=full")
    assert true < 1e-10  # what goes round with the body: (n / w)^2 (B - A) / C
    announced = averaged.summary["modelling"]["momentum_axis"]
    assert true / 1.5 < announced < 10 * true
    true, announced = (
        apart("integrator.precision=extended"),
        averaged.summary["accuracy"]["estimated_attitude_error"],
    )
    assert true / 3 < announced < 20 * max(true, 1e-16)


def test_resumed_at_edges_it_has_the_same_bits(tmp_path: Path) -> None:
    (tmp_path / "planet.toml").write_text(scene(EARTH, "sun", "moon") + "estimate = false\n")
    whole = rigidsim.run(tmp_path / "planet.toml", out=tmp_path / "whole")
    steps = whole.summary["cost"]["steps"]
    for stop in (1, steps // 2, steps - 1):
        changes = {"limits.max_steps": stop}
        rigidsim.run(tmp_path / "planet.toml", out=tmp_path / "begun", changes=changes, force=True)
        resumed = rigidsim.resume(tmp_path / "begun" / "planet", overrides={"limits.max_steps": 10**6})
        same_bits(whole, resumed)


BAD = {
    "orbits": (scene(EARTH, "sun"), "model.level=orbit_averaged", 'the kernel gives places of "sun"'),
    "resonance": (
        scene(MOON, "earth"),
        "model.short_period=false",
        "a resonance, which no average may pass over",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_what_has_no_average_is_refused(name: str) -> None:
    text, setting, words = BAD[name]
    with pytest.raises(ConfigError) as caught:
        run_text(text, setting)
    assert words in str(caught.value)
    assert '"spin_averaged"' in str(caught.value) or 'level = "full"' in str(caught.value)
