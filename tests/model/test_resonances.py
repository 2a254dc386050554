"""A rotation in step with its source, averaged: against sums over the orbit, and against every rotation."""

from __future__ import annotations

import math

import heyoka as hy
import numpy as np
import pytest
from equations import EPS, Random, derivative, matrix
from support import config, run_text

import rigidsim
from rigidsim import ConfigError, parse
from rigidsim.model.averaged import resonance
from rigidsim.solve.problem import InitialValueProblem, prepare

MOMENTS = np.array([0.998, 0.999, 1.0])


def scene(
    spin: float,
    eccentricity: float,
    *,
    level: str = "orbit_averaged",
    end: float = 10,
    samples: int = 201,
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
    return config(body, start, load, f"end = {end}\nsamples = {samples}", "", output, model)


def averaged(*given: object, **more: object) -> InitialValueProblem:
    return prepare(parse(scene(*given, **more)))  # type: ignore[arg-type]


def sums(
    multiple: int, eccentricity: float, frame: np.ndarray, momentum: np.ndarray, orbit: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean torques over the anomaly, in space and in the body, seen along the frame's axes; and the mean
    potential: of axes that go round p times uniformly about the momentum.

    Args:
        frame: a, b, c as columns.
        momentum: along them.
        orbit: P and T as columns.
    """
    turns = 1 + multiple % 2
    count = 512 * turns
    mean = 2 * np.pi * np.arange(count) / 512
    anomaly = mean.copy()
    for _ in range(100):
        anomaly -= (anomaly - eccentricity * np.sin(anomaly) - mean) / (1 - eccentricity * np.cos(anomaly))
    place = np.array([np.cos(anomaly) - eccentricity, math.sqrt(1 - eccentricity**2) * np.sin(anomaly)]).T
    about = frame @ momentum / np.linalg.norm(momentum)
    in_space, in_body, potential = np.zeros(3), np.zeros(3), 0.0
    for r, m in zip(place @ orbit.T, mean, strict=True):
        half = multiple * m / 4
        body = matrix(np.array([math.cos(half), *(math.sin(half) * about)])) @ frame
        size = np.linalg.norm(r)
        torque = 3 / size**5 * np.cross(r, body @ (MOMENTS * (body.T @ r)))
        in_space += torque / count
        in_body += body.T @ torque / count
        potential += 1.5 / size**5 * (MOMENTS * (body.T @ r) ** 2).sum() / count
    return frame.T @ in_space, in_body, potential


def turned_orbit(inclination: float, node: float, periapsis: float) -> np.ndarray:
    """P and T as columns."""
    found = np.eye(3)
    for angle, axis in ((node, 2), (inclination, 0), (periapsis, 2)):
        vector = math.sin(angle / 2) * np.eye(3)[axis]
        found = found @ matrix(np.array([math.cos(angle / 2), *vector]))
    return found[:, :2]


@pytest.fixture
def first_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without what the mean leaves out to second order."""
    monkeypatch.setattr(resonance, "second_order", lambda *given: (0.0,) * 8)


@pytest.mark.parametrize(("multiple", "eccentricity"), [(2, 0.05), (2, 0.3), (3, 0.2), (5, 0.5)])
@pytest.mark.usefixtures("first_order")
def test_the_rates_are_means_over_the_orbit(multiple: int, eccentricity: float) -> None:
    """At an obliquity and a wobble of any size, against sums over the anomaly."""
    random = Random(multiple)
    angles = "inclination = 0.4, ascending_node = 0.7, periapsis = 1.1, mean_anomaly = 0.3"
    spin = multiple / 2 + 1e-3
    q = random.quaternion()
    system = averaged(spin, eccentricity, quaternion=q.tolist(), orbit=angles).system
    assert system.states == ["rw", "rx", "ry", "rz", "la", "lb", "excess"]
    exponents = np.array(system.state_exponents)
    slow = np.ldexp(np.array([float(x) for x in system.initial]), exponents)
    slow[4:6] += [0.03, -0.02]
    found = derivative(system, slow)
    w, x, y, z = slow[:4]
    # W from q' = q (0, W) / 2
    inverse = np.array([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    rates = 2 * inverse @ found[:4]
    momentum = slow[4:] + np.array([0, 0, multiple / 2])
    orbit = turned_orbit(0.4, 0.7, 1.1)
    in_space, in_body, _ = sums(multiple, eccentricity, matrix(slow[:4]), momentum, orbit)
    size = np.linalg.norm(momentum)
    about, own = momentum / size, momentum / MOMENTS
    # what turns the body's axes with the momentum, beyond what turns it within them
    expected = own - multiple / 2 * about + np.cross(about, in_space - in_body) / size
    # the trapezoidal rule at 512 points has converged to rounding at e = 0.5
    np.testing.assert_allclose(rates, expected, atol=100 * EPS)
    np.testing.assert_allclose(found[4:], np.cross(momentum, own) + in_body, atol=100 * EPS)


def test_the_second_order_is_the_exact_precession_on_a_circle() -> None:
    """Roll and yaw of a satellite on a circular orbit, s^4 + n^2 (1 + 3 x + x z) s^2 + 4 n^4 x z = 0: the
    root near n is the precession of the pole, which the mean alone makes faster by 3/4 (C - A)/C of it.
    """
    least, middle, most = MOMENTS
    x, z = (most - least) / middle, (most - middle) / least
    half = (1 + 3 * x + x * z) / 2
    exact = math.sqrt(half + math.sqrt(half**2 - 4 * x * z)) - 1
    found = {}
    for tilt in (1e-3, 2e-3):
        half_tilt = tilt / 2
        quaternion = [math.cos(half_tilt), math.sin(half_tilt), 0.0, 0.0]
        system = averaged(1.0, 0.0, quaternion=quaternion, orbit="inclination = 0").system
        # in step, its axis along the momentum: what turns that is all torque
        rates = derivative(system, np.array([*quaternion, 0.0, 0.0, 0.0]))
        w, p, y, r = quaternion
        turning = 2 * (np.array([[-p, w, r, -y], [-y, -r, w, p], [-r, y, -p, w]]) @ rates[:4])
        # s' = W x s + (m' - ..) / L, along the node
        change = np.cross(turning, [0, 0, 1]) + np.array([rates[4], rates[5], 0.0])
        found[tilt] = float(change[0]) / tilt
    assert found[1e-3] == pytest.approx(found[2e-3], rel=1e-5)
    first = 1.5 * (most - least)
    assert abs(abs(found[1e-3]) / exact - 1) < 10 * (most - least) ** 2
    assert first / exact - 1 == pytest.approx(0.75 * (most - least), rel=0.01)


@pytest.fixture(scope="module")
def both() -> dict[float, tuple[rigidsim.Run, rigidsim.Run]]:
    """Three librations in longitude and more, near the Moon's resonance and Mercury's."""
    found = {}
    for spin, eccentricity in ((1.005, 0.05), (1.5, 0.2)):
        revolutions = 56 if spin < 1.2 else 72
        end, samples = 2 * math.pi * revolutions, 8 * revolutions + 1
        found[spin] = (
            run_text(
                scene(
                    spin, eccentricity, end=end, samples=samples, record='"momentum_axis", "resonant_angle"'
                )
            ),
            run_text(
                scene(
                    spin,
                    eccentricity,
                    level="full",
                    end=end,
                    samples=samples,
                    record='"momentum_axis", "quaternion"',
                )
            ),
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
    apart = (full.dataset.momentum_axis.values - average.dataset.momentum_axis.values)[:-1]
    # a nutation of 1.5 (C - A)/C sin(obliquity), enlarged by (1 - e)^-3 at the pericentre
    flattening = 1.5 * (MOMENTS[2] - MOMENTS[0])
    eccentricity = 0.05 if spin < 1.2 else 0.2
    nutation = flattening * math.sin(math.radians(8)) * (1 - eccentricity) ** -3
    assert np.linalg.norm(apart, axis=1).max() < nutation
    # averaged over two revolutions, and relative to the path: 1.5 % at 1:1 without wobble and second order,
    # of which the harmonics left out are of the order of e^2, of e at 3:2
    mean = apart.reshape(-1, 16, 3).mean(axis=1)
    left_out = eccentricity**2 if spin < 1.2 else eccentricity
    assert np.linalg.norm(mean, axis=1).max() < 3 * flattening * (flattening + left_out) * path.max()


@pytest.mark.usefixtures("first_order")
def test_the_slow_energy_is_kept_on_an_orbit_that_rests() -> None:
    """m . I^-1 m / 2 - p n L + <U> is the Hamiltonian of the averaged motion where the orbit doesn't move."""
    system = averaged(1.005, 0.1, orbit='inclination = "20 deg"').system
    exponents = np.array(system.state_exponents)
    engine = hy.taylor_adaptive(
        system.equations, [float(x) for x in system.initial], compact_mode=True, opt_level=0, tol=2.0**-42
    )
    energies, potentials = [], []
    orbit = turned_orbit(math.radians(20), 0.0, 0.0)
    for time in np.linspace(0.0, math.ldexp(300.0, -system.scaling.time), 9):
        engine.propagate_until(time)
        slow = np.ldexp(engine.state, exponents)
        momentum = slow[4:] + np.array([0.0, 0, 1])
        _, _, potential = sums(2, 0.1, matrix(slow[:4]), momentum, orbit)
        free = (momentum**2 / MOMENTS).sum() / 2 - np.linalg.norm(momentum)
        energies.append(free + potential)
        potentials.append(potential)
    assert np.ptp(potentials) > 1e-5
    assert np.ptp(energies) < 1e-11  # 1024 epsilon along some thirty steps


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"level": "spin_averaged"}, 'choose level = "orbit_averaged", which keeps its angle'),
        (
            {"more": "short_period = true"},
            r"in resonance with \[\[loads\]\] number 1 \(1:1\).*set it to false",
        ),
        ({"record": '"quaternion"'}, 'given "quaternion": needs every rotation'),
    ],
)
def test_what_a_resonance_can_not_give_is_refused(given: dict[str, str], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        averaged(1.005, 0.05, **given)
