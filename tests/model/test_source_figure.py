"""An oblate source: its torque against two bodies of point masses, its energy, and the Earth's pole."""

import re

import erfa
import heyoka as hy
import numpy as np
import pytest
from equations import CLOSE, Random, array, derivative, matrix, prepared
from support import config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.model.loads.gravity import earth_pole
from rigidsim.scene.epochs import parse_epoch
from rigidsim.solve.problem import prepare

MOMENTS = "principal_moments = [1, 1.2, 1.5]"
START = "angular_velocity = [0.1, 0.4, 0.5]\neuler_angles = [0.3, 0.7, 0.2]"
ORBIT = "orbit = {semi_major_axis = 2, eccentricity = 0.2, inclination = 0.3}"


def oblate(place: str, pole: str = "[0.2, -0.1, 1]", size: str = "J2 = 0.1, radius = 0.8") -> str:
    load = f'kind = "gravity_gradient"\ngravitational_parameter = 2\n{place}\n'
    return load + f"figure = {{{size}, pole = {pole}}}"


def turned(place: np.ndarray, pole: np.ndarray, tensor: np.ndarray, q: np.ndarray, figure: str) -> np.ndarray:
    """Torque in body axes on a body at rest in the scene."""
    load = f'kind = "gravity_gradient"\ngravitational_parameter = 1\nposition = {array(place)}\n'
    load += f"figure = {{{figure}, pole = {array(pole)}}}" if figure else ""
    start = f"angular_velocity = [0, 0, 0]\nquaternion = {array(q)}"
    system = prepared(f"inertia_tensor = {array(tensor)}", start, load).system
    return tensor @ derivative(system, np.array([0, 0, 0, *q]))[:3]


def test_the_torque_is_that_of_the_formula_in_any_axes() -> None:
    random = Random(1)
    for _ in range(2):
        tensor, q, place, pole = random.tensor(), random.quaternion(), random.vector(2), random.vector()
        found = turned(place, pole, tensor, q, "J2 = 0.1, radius = 0.8") - turned(place, pole, tensor, q, "")
        r = np.linalg.norm(place)
        u, p = matrix(q).T @ place / r, matrix(q).T @ pole / np.linalg.norm(pole)
        s, iu, ip = u @ p, tensor @ u, tensor @ p
        inner = (1 - 7 * s * s) * np.cross(u, iu) + 2 * s * (np.cross(u, ip) + np.cross(p, iu))
        expected = 7.5 * 0.1 * 0.8**2 / r**5 * (inner - 0.4 * np.cross(p, ip))
        scale = np.abs(expected).max() + np.abs(turned(place, pole, tensor, q, "")).max()
        assert np.abs(found - expected).max() < 10 * CLOSE * scale


@pytest.mark.parametrize(
    ("place", "pole", "kept"),
    [
        pytest.param("position = [2, 0.3, 0.2]", "[0.2, -0.1, 1]", {"energy"}, marks=pytest.mark.slow),
        ("position = [0, 0, 2]", "[0, 0, 1]", {"energy", "angular_momentum_source"}),
        ("orbit = {semi_major_axis = 2}", "[0, 0, 3]", {"energy_balance", "jacobi_constant"}),
        pytest.param(
            "orbit = {semi_major_axis = 2}", "[0.1, 0, 3]", {"energy_balance"}, marks=pytest.mark.slow
        ),
    ],
)
def test_what_is_conserved_is_found_and_nothing_else(place: str, pole: str, kept: set[str]) -> None:
    run = run_text(config(MOMENTS, START, oblate(place, pole), "end = 200\nsamples = 41"))
    drifts = {name: row["largest_drift"] for name, row in run.summary["invariants"].items()}
    assert {name for name in drifts if "norm" not in name} == kept
    assert max(drifts.values()) < 2e-14


@pytest.mark.parametrize("axes", ["ICRF", "ecliptic J2000"])
def test_the_earths_pole_is_that_of_iau_1976_and_the_largest_nutation(axes: str) -> None:
    text = config(
        MOMENTS, START, oblate(ORBIT, '"iau1976"'), "end = 1\nsamples = 2\nepoch = \"J2000\"",
        more=f'[frame]\naxes = "{axes}"\n',
    )  # fmt: skip
    m = prepare(rigidsim.parse(text)).system.mechanics
    function = hy.cfunc(earth_pole(m, parse_epoch("J2000"), axes), [], compact_mode=True)
    arcsec = np.pi / 180 / 3600
    for day in (-36000.0, -18000.0, -5000.0, 123.0, 9000.0):
        centuries = day / 36525
        node = (450160.280 - 6962890.539 * centuries + 7.455 * centuries**2) * arcsec
        longitude = -(17.1996 + 0.01742 * centuries) * np.sin(node) * arcsec
        obliquity = (9.2025 + 0.00089 * centuries) * np.cos(node) * arcsec
        tilt = erfa.obl80(2451545.0, day)
        nutation = erfa.numat(tilt, longitude, obliquity)
        expected = (nutation @ erfa.pmat76(2451545.0, day))[2]
        # and what it leaves out of the full theory
        full = (erfa.nutm80(2451545.0, day) @ erfa.pmat76(2451545.0, day))[2]
        if axes != "ICRF":
            c, s = np.cos(84381.406 * arcsec), np.sin(84381.406 * arcsec)
            turn = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
            expected, full = turn @ expected, turn @ full
        unit = float(m.scene.context.ldexp(m.scene.context.one, m.scaling.time))
        found = np.asarray(function([], time=day * 86400 / unit))
        assert np.abs(found - expected).max() < 0.02 * arcsec
        assert np.linalg.norm(found - full) < 1.5 * arcsec


NONSENSE = {
    "no date": (oblate(ORBIT, '"iau1976"'), "takes [time] epoch"),
    "no pole": (oblate(ORBIT, "[0, 0, 0]"), "a direction is needed"),
    "of a planet": (oblate(ORBIT, '"mars"'), "iau1976"),
}


@pytest.mark.parametrize("which", NONSENSE)
def test_nonsense_is_refused(which: str) -> None:
    load, message = NONSENSE[which]
    with pytest.raises(ConfigError, match=re.escape(message)):
        prepare(rigidsim.parse(config(MOMENTS, START, load)))
