"""Tilt, precession and spin of a top, and the path of its tip: definitions and closed forms."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from mpmath import mp
from support import CONFIGS, EPSILON, config, loaded, run_text, wide
from test_orbit_observables import cross, exactly, rotation, unit

import rigidsim
from rigidsim import ConfigError

READY = {path.stem: path for path in CONFIGS}
NAMES = ("tilt", "precession_angle", "spin_angle", "tip")
RECORD = 'record = ["quaternion", "euler_angles", "tilt", "precession_angle", "spin_angle", "tip"]'
TOP = 'principal_moments = [2, 2, 1]\nmass = 3\ncenter_of_mass = [0, 0, "0.4"]'


def ready(name: str, out: Path, *overrides: str) -> xarray.Dataset:
    experiment = rigidsim.load(READY[name], overrides=["output.timeline=false", *overrides])
    return loaded(rigidsim.run(experiment, out=out, force=True))


def apart(angle: Any, other: Any) -> float:
    """Difference of two angles but for whole turns."""
    return float(abs(mp.fmod(angle - other + 101 * mp.pi, 2 * mp.pi) - mp.pi))


@pytest.mark.parametrize("up", [(0, 0, 1), (2, -1, 2)], ids=["Z", "oblique"])
def test_they_are_their_definitions_to_80_bits(up: tuple[int, int, int]) -> None:
    """From the recorded quaternion in 40 digits: z-x-z angles where Z is up, else by Rodrigues' rotation."""
    gravity = f"acceleration = [{', '.join(str(-3 * x) for x in up)}]"
    start = 'angular_velocity = ["0.1", "0.3", 9]\neuler_angles = ["0.4", "1.1", "0.7"]'
    load = f'kind = "uniform_gravity"\n{gravity}'
    text = config(TOP, start, load, "end = 3\nsamples = 61", 'precision = "extended"', RECORD)
    dataset = loaded(run_text(text))
    with mp.workdps(40):
        normal = unit(mp.matrix(up))
        z, x = mp.matrix([0, 0, 1]), mp.matrix([1, 0, 0])
        # the smallest rotation that takes Z to the normal, applied to X
        axis, c = cross(z, normal), normal[2]
        first = x if up[:2] == (0, 0) else x * c + cross(axis, x) + axis * (axis[0] / (1 + c))
        second = cross(normal, first)
        for row in range(0, 61, 6):
            matrix = rotation(exactly(wide(dataset, "quaternion")[row]))
            pole = matrix * z
            vertical = matrix.T * normal
            along = [sum(a * b for a, b in zip(e, pole, strict=True)) for e in (first, second, normal)]
            angles = {
                "tilt": mp.acos(along[2]),
                "precession_angle": mp.atan2(along[0], -along[1]),
                "spin_angle": mp.atan2(vertical[0], vertical[1]),
            }
            for name, expected in angles.items():
                (got,) = exactly(wide(dataset, name)[row])
                assert apart(got, expected) < 40 * EPSILON["extended"], name
            place = exactly(wide(dataset, "tip")[row])
            assert (
                max(abs(a - b * mp.mpf("0.4")) for a, b in zip(place, pole, strict=True))
                < EPSILON["extended"]
            )
    if up == (0, 0, 1):
        euler = np.stack([wide(dataset, name) for name in ("precession_angle", "tilt", "spin_angle")], axis=1)
        assert np.abs(euler - wide(dataset, "euler_angles")).max() < 100 * EPSILON["extended"]
    assert dataset["tip"].attrs["units"] == "m"
    assert "[0.0, 0.0, 0.4]" in dataset["tip"].attrs["point"]
    assert "axis of symmetry" in dataset["tilt"].attrs["figure_axis"]


def test_regular_precession_keeps_its_tilt_and_counts_every_turn_of_sparse_samples(runs: Path) -> None:
    """phi' = 2 rad/s at 60 degrees; psi' = w3 - phi' cos(theta): 79 turns from one sample to the next."""
    dataset = ready("heavy_top_regular_precession", runs, "time.samples=5")
    assert set(NAMES) <= set(dataset)  # by default
    time = dataset["time"].values
    assert np.abs(dataset["tilt"].values - np.pi / 3).max() < 1e-11
    assert np.abs(dataset["precession_angle"].values - 2 * time).max() < 1e-9
    spin = dataset["spin_angle"].values
    assert np.abs(spin - (198.133 - 1) * time).max() < 1e-8
    assert spin[1] > 78 * 2 * np.pi
    height = dataset["tip"].sel(space_axis="Z").values
    assert np.abs(height - 0.04 / 2).max() < 1e-12


def test_the_tip_is_the_point_that_is_given() -> None:
    """In free flight it goes with the centre of mass; where nothing says which point it is, that is said."""
    start = "angular_velocity = [1, 2, 3]\nposition = [7, 8, 9]\nvelocity = [1, 0, -2]"
    body = "principal_moments = [1, 2, 2.5]\nmass = 2"
    output = 'tip = [0, "10 cm", 2]\nrecord = ["tip", "quaternion", "position"]'
    dataset = loaded(run_text(config(body, start, output=output)))
    with mp.workdps(30):
        for row in (0, 24, 48):
            matrix = rotation(exactly(dataset["quaternion"].values[row]))
            expected = matrix * mp.matrix([0, mp.mpf("0.1"), 2]) + mp.matrix(
                exactly(dataset["position"].values[row])
            )
            got = exactly(dataset["tip"].values[row])
            assert max(abs(a - b) for a, b in zip(got, expected, strict=True)) < 30 * EPSILON["double"]
    plain = loaded(run_text(config(output="tip = [0, 0, 1]", time="end = 1\nsamples = 2")))
    assert "tip" in plain  # named by its point
    for output, said in (
        ('record = ["tip"]', r"tip = \[x, y, z\]"),
        ('tip = [0, 0, 1]\nrecord = ["quaternion"]', "name it there, or leave tip out"),
    ):
        with pytest.raises(ConfigError, match=said):
            run_text(config(output=output))
