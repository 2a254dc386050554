"""A rotation in step with its source, averaged: against sums over the orbit, and against every rotation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from equations import EPS, Random, derivative, matrix
from support import config, run_text

import rigidsim
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.hansen import hansen
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.config import parse
from rigidsim.solve.problem import InitialValueProblem, prepare

CONTEXT = context_for("double")


def test_hansen_coefficients_have_their_published_series() -> None:
    """H(p, e) of Goldreich & Peale 1966, as continued by Murray & Dermott 1999, eq. 5.77 ff."""
    e = CONTEXT.mpf("0.01")
    series = {
        2: 1 - 5 * e**2 / 2 + 13 * e**4 / 16,
        3: 7 * e / 2 - 123 * e**3 / 16,
        1: -e / 2 + e**3 / 16,
        4: 17 * e**2 / 2 - 115 * e**4 / 6,
    }
    for multiple, expected in series.items():
        assert abs(hansen(CONTEXT, e, multiple, 2) - expected) < 30 * e**5  # the next terms
    exact = context_for("quadruple")
    # <(a/r)^3> = (1 - e^2)^(-3/2)
    for eccentricity in ("0.2056", "0.7"):
        f = exact.mpf(eccentricity)
        assert abs(hansen(exact, f, 0, 0) * (1 - f * f) ** exact.mpf("1.5") - 1) < 1e-33


MOMENTS = np.array([0.998, 0.999, 1.0])


def scene(
    spin: float,
    eccentricity: float,
    *,
    level: str = "orbit_averaged",
    end: float = 10,
    quaternion: list[float] | None = None,
    orbit: str = 'inclination = "3 deg", node_rate = -0.002',
    more: str = "",
    record: str = "",
) -> str:
    start = f"angular_velocity = [0, 0, {spin}]\n"
    start += 'euler_angles = [0, "5 deg", 0.1]' if quaternion is None else f"quaternion = {quaternion}"
    load = f"""kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {{semi_major_axis = 1, eccentricity = {eccentricity}, {orbit}}}"""
    output = f"record = [{record}]" if record else ""
    model = f'[model]\nlevel = "{level}"\n{more}'
    body = f"principal_moments = {MOMENTS.tolist()}"
    return config(body, start, load, f"end = {end}\nsamples = 201", "", output, model)


def averaged(*given: object, **more: object) -> InitialValueProblem:
    return prepare(parse(scene(*given, **more)))  # type: ignore[arg-type]


@pytest.mark.parametrize(("multiple", "eccentricity"), [(2, 0.05), (2, 0.3), (3, 0.2), (5, 0.5)])
def test_the_torque_is_the_mean_over_the_orbit(multiple: int, eccentricity: float) -> None:
    """At an obliquity of any size: of a body that goes round p times uniformly, summed over the anomaly."""
    q = Random(multiple).quaternion()
    angles = "inclination = 0.4, ascending_node = 0.7, periapsis = 1.1, mean_anomaly = 0.3"
    spin = multiple / 2 + 1e-3
    system = averaged(spin, eccentricity, quaternion=q.tolist(), orbit=angles).system
    assert system.states == ["rw", "rx", "ry", "rz", "excess"]
    exponents = np.array(system.state_exponents)
    slow = np.ldexp(np.array([float(x) for x in system.initial]), exponents)
    found = derivative(system, slow)
    frame = matrix(slow[:4])
    # W from q' = q (0, W) / 2
    w, x, y, z = slow[:4]
    inverse = np.array([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    rates = 2 * inverse @ found[:4]
    count = 512
    mean = 2 * np.pi * np.arange(count) / count
    anomaly = mean.copy()
    for _ in range(100):
        anomaly -= (anomaly - eccentricity * np.sin(anomaly) - mean) / (1 - eccentricity * np.cos(anomaly))
    place = np.array([np.cos(anomaly) - eccentricity, math.sqrt(1 - eccentricity**2) * np.sin(anomaly)]).T
    orbit = matrix(np.array([math.cos(0.35), 0, 0, math.sin(0.35)]))
    orbit = orbit @ matrix(np.array([math.cos(0.2), math.sin(0.2), 0, 0]))
    orbit = orbit @ matrix(np.array([math.cos(0.55), 0, 0, math.sin(0.55)]))
    seen = place @ orbit[:, :2].T
    total = np.zeros(3)
    for r, m in zip(seen, mean, strict=True):
        half = multiple * m / 4
        body = frame @ matrix(np.array([math.cos(half), 0, 0, math.sin(half)]))
        size = np.linalg.norm(r)
        total += 3 / size**5 * np.cross(r, body @ (MOMENTS * (body.T @ r))) / count
    momentum = multiple / 2 + slow[4]
    expected = frame.T @ total
    # the trapezoidal rule at 512 points has converged to rounding at e = 0.5
    across = np.array([-expected[1], expected[0]]) / momentum
    np.testing.assert_allclose(rates[:2], across, atol=100 * EPS)
    assert rates[2] == pytest.approx(momentum - multiple / 2, abs=10 * EPS)  # C = 1
    assert found[4] == pytest.approx(expected[2], abs=100 * EPS)


@pytest.fixture(scope="module")
def both() -> dict[float, tuple[rigidsim.Run, rigidsim.Run]]:
    """Three librations in longitude and more, near the Moon's resonance and Mercury's."""
    found = {}
    for spin, eccentricity in ((1.005, 0.05), (1.5, 0.2)):
        end = 350 if spin < 1.2 else 450
        axis = '"momentum_axis", '
        average = run_text(scene(spin, eccentricity, end=end, record=axis + '"resonant_angle"'))
        found[spin] = (
            average,
            run_text(scene(spin, eccentricity, level="full", end=end, record=axis + '"quaternion"')),
        )
    return found


def kept_angle(run: rigidsim.Run, turns: float) -> np.ndarray:
    """Of the full run: the long axis against the pericentre, less so many turns to a revolution."""
    w, x, y, z = run.dataset.quaternion.values.T
    time = run.dataset.time.values
    long = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]).T
    pole = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]).T
    node = -0.002 * time
    pericentre = np.array([np.cos(node), np.sin(node), 0 * node]).T
    sine = (np.cross(pericentre, long) * pole).sum(axis=1)
    return np.unwrap(2 * (np.arctan2(sine, (pericentre * long).sum(axis=1)) - turns * time)) / 2


@pytest.mark.parametrize("spin", [1.005, 1.5])
def test_the_commensurable_angle_is_that_of_every_rotation(
    spin: float, both: dict[float, tuple[rigidsim.Run, rigidsim.Run]]
) -> None:
    average, full = both[spin]
    turns = round(2 * spin) / 2
    found, true = average.dataset.resonant_angle.values, kept_angle(full, turns)
    apart = found - true
    apart -= np.round(apart.mean() / np.pi) * np.pi
    # what goes round with the orbit swings the angle by the torque over n^2, some (3/2) (B - A)/C in all
    asymmetry = 1.5 * (MOMENTS[1] - MOMENTS[0])
    assert np.abs(apart).max() < 2 * asymmetry
    assert np.ptp(found) > 6 * asymmetry  # and it does librate
    path = np.linalg.norm(full.dataset.momentum_axis.values - full.dataset.momentum_axis.values[0], axis=1)
    error = np.linalg.norm(full.dataset.momentum_axis.values - average.dataset.momentum_axis.values, axis=1)
    # a nutation of 1.5 (C - A)/C sin(obliquity), and relative errors of the order of 1.5 (C - A)/C
    flattening = 1.5 * (MOMENTS[2] - MOMENTS[0])
    assert error.max() < flattening * 0.15 + 3 * flattening * path.max()


def test_the_slow_energy_is_kept_on_an_orbit_that_rests() -> None:
    """L^2 / 2 C - p n L + <U> of the averaged system is its Hamiltonian where the orbit doesn't move."""
    given = scene(
        1.005,
        0.1,
        orbit='inclination = "20 deg"',
        end=300,
        record='"momentum_axis", "angular_momentum_norm", "resonant_angle"',
    )
    run = run_text(given)
    size, axis = run.dataset.angular_momentum_norm.values, run.dataset.momentum_axis.values
    normal = np.array([0, -math.sin(math.radians(20)), math.cos(math.radians(20))])
    z = axis @ normal
    # a is at the angle kept from P's projection: with c = P - (P . s) s, a = (c cos g + (s x c) sin g) / |c|
    g = run.dataset.resonant_angle.values[:, None]
    p, t = np.array([1.0, 0, 0]), np.cross(normal, [1.0, 0, 0])
    c = p - (axis @ p)[:, None] * axis
    c /= np.linalg.norm(c, axis=1)[:, None]
    a = c * np.cos(g) + np.cross(axis, c) * np.sin(g)
    b = np.cross(axis, a)
    x0, x2, xm = (float(hansen(CONTEXT, CONTEXT.mpf("0.1"), 2, m)) for m in (0, 2, -2))
    pa, pb, ta, tb = a @ p, b @ p, a @ t, b @ t
    h = x0 * (pa**2 - pb**2 + ta**2 - tb**2) / 2
    h += x2 * ((pa + tb) ** 2 - (pb - ta) ** 2) / 4 + xm * ((pa - tb) ** 2 - (pb + ta) ** 2) / 4
    excess, half = MOMENTS[2] - (MOMENTS[0] + MOMENTS[1]) / 2, (MOMENTS[1] - MOMENTS[0]) / 2
    potential = 1.5 * (-excess * z**2 * (1 - 0.01) ** -1.5 / 2 - half * h)
    # the tolerance of averaged motions, 1024 epsilon, along some fifty steps
    slow = size**2 / 2 - size + potential
    assert np.ptp(potential) > 1e-5
    assert np.ptp(slow) < 1e-11


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"level": "spin_averaged"}, 'choose level = "orbit_averaged", which keeps its angle'),
        ({"more": "short_period = true"}, r"keeps pace with \[\[loads\]\] number 1 \(1:1\).*set it to false"),
        ({"record": '"quaternion"'}, 'given "quaternion": needs every rotation'),
    ],
)
def test_what_a_resonance_can_not_give_is_refused(given: dict[str, str], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        averaged(1.005, 0.05, **given)


def test_the_angle_is_no_other_scenes() -> None:
    with pytest.raises(ConfigError, match=r'given "resonant_angle": is of.*where the body keeps pace'):
        averaged(1.005, 0.05, level="full", record='"resonant_angle"')
