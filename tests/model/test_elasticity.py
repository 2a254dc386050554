"""Elastic bodies: by equations of their own, closed forms and limits; what is conserved; what is refused."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
from elastic_bodies import Delayed, followed, strength
from support import EPSILON, config, law, run_text, same_bits, wide
from test_rotors import matrices

import rigidsim

MOMENTS, RATES = ["1", "1.0004", "1.001"], ["0.01", "-0.02", "1.05"]
ELASTIC = 'love_number = 0.3, radius = "2 mm"'  # distorts by 1e-4
MOON = 'kind = "gravity_gradient"\nname = "planet"\ngravitational_parameter = 1\n'
MOON += "orbit = {semi_major_axis = 1, eccentricity = 0.1}"


def scene(end: float, elastic: str = ELASTIC, samples: int = 21, loads: str = MOON, **more: str) -> str:
    body = f"principal_moments = [{', '.join(MOMENTS)}]"
    body += f"\nelasticity = {{{elastic}}}" if elastic else ""
    initial = more.pop("initial", f"angular_velocity = [{', '.join(RATES)}]")
    return config(body=body, initial=initial, time=f"end = {end}\nsamples = {samples}", loads=loads, **more)


def assert_sound(run: rigidsim.Run) -> None:
    rows = run.summary["invariants"]
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


def orbit_start(eccentricity: str = "0.1") -> list[list[Any]]:
    """At the pericentre of an orbit of size and motion 1."""
    with mpmath.workdps(50):
        e = mpmath.mpf(eccentricity)
        swift = mpmath.nstr(mpmath.sqrt((1 + e) / (1 - e)), 45)
        return [[mpmath.nstr(1 - e, 45), 0, 0], [0, swift, 0]]


# --- without delay ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("precision", "formulation", "end", "within"),
    # rounding in some thousands of steps, amplified by librations
    [
        ("double", "quaternion", 50, 5e-13),
        ("double", "rotation_matrix", 20, 5e-13),
        ("double", "euler_angles", 20, 5e-13),
        ("single", "quaternion", 20, 2e-4),
        pytest.param("quadruple", "quaternion", 20, 1e-18, marks=pytest.mark.slow),
    ],
)
def test_without_delay(precision: str, formulation: str, end: float, within: float) -> None:
    integrator = f'precision = "{precision}"\nformulation = "{formulation}"'
    run = run_text(scene(end, integrator=integrator))
    times = run.dataset["time"].values
    elastic = strength("0.3", "0.002")
    rates, attitudes, momenta = followed(MOMENTS, elastic, RATES[2], 1, orbit_start(), RATES, times)
    assert np.abs(wide(run.dataset, "angular_velocity") - rates).max() <= within
    assert np.abs(matrices(run.dataset) - attitudes).max() <= within
    assert np.abs(wide(run.dataset, "angular_momentum") - momenta).max() <= within
    assert_sound(run)
    assert "energy_balance" in run.summary["invariants"]


@pytest.mark.slow
@pytest.mark.optimised  # as runs are: what isn't rounds more
@pytest.mark.parametrize(
    # the attitude adds up what the rates wander by, a thousand radians long
    ("precision", "rates_within"),
    [("double", 1e-12), ("extended", 1e-15)],
)
def test_a_thousand_radians(precision: str, rates_within: float) -> None:
    run = run_text(scene(1000, integrator=f'precision = "{precision}"'))
    fastest = float(np.linalg.norm(run.dataset["angular_velocity"].values, axis=1).max())
    attitude_within = 3 * law(EPSILON[precision], run.summary["cost"]["steps"], fastest, 1000)
    times, elastic = run.dataset["time"].values, strength("0.3", "0.002")
    rates, attitudes, momenta = followed(MOMENTS, elastic, RATES[2], 1, orbit_start(), RATES, times)
    assert np.abs(wide(run.dataset, "angular_velocity") - rates).max() <= rates_within
    assert np.abs(wide(run.dataset, "angular_momentum") - momenta).max() <= rates_within
    assert np.abs(matrices(run.dataset) - attitudes).max() <= attitude_within
    assert_sound(run)


@pytest.mark.parametrize("formulation", ["quaternion", "euler_angles"])
def test_tides_alone(formulation: str) -> None:
    elastic = f"{ELASTIC}, spin = false"
    run = run_text(scene(50, elastic, integrator=f'formulation = "{formulation}"'))
    times = run.dataset["time"].values
    size = strength("0.3", "0.002")
    found = followed(MOMENTS, size, RATES[2], 1, orbit_start(), RATES, times, spins=False)
    assert np.abs(wide(run.dataset, "angular_velocity") - found[0]).max() <= 5e-13
    assert np.abs(matrices(run.dataset) - found[1]).max() <= 5e-13
    assert np.abs(wide(run.dataset, "angular_momentum") - found[2]).max() <= 5e-13
    assert_sound(run)


@pytest.mark.parametrize("source", ["", "position = [0, 1, 0.3]", "orbit = {semi_major_axis = 1}"])
def test_tides_alone_are_balanced(source: str) -> None:
    """They aren't a minimum of any energy, so that none is claimed to be conserved."""
    loads = f'kind = "gravity_gradient"\ngravitational_parameter = 1\n{source}' if source else ""
    run = run_text(scene(50, f"{ELASTIC}, spin = false", loads=loads))
    assert_sound(run)
    found = {name for name, row in run.summary["invariants"].items() if not row["numerical"]}
    assert not source or not found & {"energy", "jacobi_constant"}


# --- with a delay -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("delay", "end", "within"),
    [(0.01, 8, 4e-8), pytest.param(0.0025, 30, 6e-10, marks=pytest.mark.slow)],
)
def test_with_a_delay_up_to_its_third_order(delay: float, end: float, within: float) -> None:
    """The bound falls with the delay to the third: (2 tau)^3 / 6 of the distortion, whose frequency is 2."""
    run = run_text(scene(end, f"{ELASTIC}, delay = {delay}"))
    elastic = float(str(strength("0.3", "0.002")))
    truth = Delayed([float(x) for x in MOMENTS], elastic, delay, float(RATES[2]), 1.0, 1.0, 0.1)
    rates, attitudes, distortions = truth.followed([float(x) for x in RATES], run.dataset["time"].values)
    np.testing.assert_allclose(run.dataset["angular_velocity"], rates, rtol=0, atol=within)
    np.testing.assert_allclose(matrices(run.dataset), attitudes, rtol=0, atol=20 * within)
    found = run.dataset["inertia_distortion"].values
    flat = [distortions[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    np.testing.assert_allclose(found, np.transpose(flat), rtol=0, atol=within)
    assert_sound(run)


# --- limits -------------------------------------------------------------------------------------------------


def test_a_love_number_of_zero_is_the_rigid_body_bit_for_bit() -> None:
    rigid = scene(20, elastic="")
    same_bits(run_text(rigid), run_text(scene(20, 'love_number = 0, radius = "2 mm", delay = 0.01')))


@pytest.mark.parametrize("source", ["", "position = [0, 1, 0.3]", "orbit = {semi_major_axis = 1}"])
def test_without_delay_nothing_is_dissipated(source: str) -> None:
    load = f'kind = "gravity_gradient"\ngravitational_parameter = 1\n{source}' if source else ""
    run = run_text(scene(50, loads=load))
    kept = {"": {"energy", "angular_momentum"}, "p": {"energy"}, "o": {"jacobi_constant"}}[source[:1]]
    found = {name for name, row in run.summary["invariants"].items() if not row["numerical"]}
    assert kept <= found
    assert "energy_balance" not in found
    assert ("energy" in found) == ("energy" in kept)
    assert_sound(run)


@pytest.mark.parametrize("load", ["", MOON, MOON.partition("orbit")[0] + "position = [0, 1, 0.3]"])
def test_with_a_delay_energy_is_balanced(load: str) -> None:
    run = run_text(scene(50, f"{ELASTIC}, delay = 0.05", loads=load))
    found = {name for name, row in run.summary["invariants"].items() if not row["numerical"]}
    assert "energy_balance" in found
    assert ("angular_momentum" in found) == (not load)
    assert not found & {"energy", "jacobi_constant", "angular_momentum_axial", "rotational_energy"}
    assert_sound(run)


# --- what tides do in the long run --------------------------------------------------------------------------

SPINDLE = 'principal_moments = [0.999, 0.999, 1]\nelasticity = {love_number = 0.3, radius = "2 mm", '
STRENGTH = 0.3 * 0.002**5 / 6.67430e-11


def test_a_fast_rotator_is_braked_as_mignard_found() -> None:
    """On a circle 3 k2 G M'^2 R^5 tau (w - n) / a^6 (Mignard 1979, The Moon and the Planets 20, 301: constant
    delay; Murray & Dermott 1999, section 4.9, with a lag of (w - n) tau).
    """
    delay, spin = 0.001, 3.0
    text = config(
        body=SPINDLE + f"delay = {delay}}}", initial=f"angular_velocity = [0, 0, {spin}]",
        loads=MOON.replace("eccentricity = 0.1", "eccentricity = 0"), time="end = 200\nsamples = 11",
    )  # fmt: skip
    data = run_text(text).dataset
    momentum = data["angular_momentum"].values[:, 2]
    slope = (momentum[-1] - momentum[0]) / 200
    expected = -3 * STRENGTH * delay * (spin - 1)
    # the third order of the delay, (2 (w - n) tau)^2 / 6, and what the spin has lost meanwhile
    assert slope == pytest.approx(expected, rel=1e-5 + abs(expected) * 200 / (spin - 1))


def test_a_synchronous_body_is_heated_on_an_eccentric_orbit() -> None:
    """(21/2) k2 n tau G M'^2 R^5 n e^2 / a^6 (Peale & Cassen 1978, Icarus 36, 245; Murray & Dermott 1999,
    section 4.10, with 1/Q = n tau), as the mean of -T : dD/dt / 2 by Fourier's sums.
    """
    delay, e, count = 0.001, 0.005, 64
    text = config(
        body=SPINDLE + f"delay = {delay}}}", initial="angular_velocity = [0, 0, 1]",
        loads=MOON.replace("0.1", str(e)), time=f"end = {2 * np.pi}\nsamples = {count + 1}",
        output='record = ["quaternion", "inertia_distortion", "tidal_power"]',
    )  # fmt: skip
    data = run_text(text).dataset
    flat = data["inertia_distortion"].values[:-1]
    lines = np.fft.fft(flat, axis=0) * 1j * np.fft.fftfreq(count, 1 / count)[:, None]
    change = np.fft.ifft(lines, axis=0).real[:, [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(-1, 3, 3)
    truth = Delayed([0.999, 0.999, 1], STRENGTH, delay, 1.0, 1.0, 1.0, e)
    power = []
    for t, r, slope in zip(data["time"].values, matrices(data), change, strict=False):
        x = r.T.astype(float) @ truth.source(t)
        d = np.linalg.norm(x)
        power.append(-1.5 * np.sum((np.outer(x, x) / d**5 - np.eye(3) / (3 * d**3)) * slope))
    expected = 10.5 * STRENGTH * delay * e**2
    # further powers of e^2 (a factor of some tens), and the spin that the torque changes
    assert np.mean(power) == pytest.approx(expected, rel=2e-3)
    assert data["tidal_power"].values[:-1].mean() == pytest.approx(expected, rel=2e-3)
    # Fourier's sums take the spin, which the torque changes, for periodic
    np.testing.assert_allclose(data["tidal_power"][:-1], power, rtol=0, atol=1e-4 * np.abs(power).max())


# --- other sources, other carriers --------------------------------------------------------------------------


def test_a_source_among_point_masses_is_one_on_a_kepler_orbit() -> None:
    body = f"principal_moments = [{', '.join(MOMENTS)}]\nelasticity = {{{ELASTIC}, delay = 0.05}}"
    rates = f"angular_velocity = [{', '.join(RATES)}]"
    orbit = MOON.replace("gravitational_parameter = 1", "gravitational_parameter = 0.75")
    orbit = orbit.replace("eccentricity = 0.1", "eccentricity = 0.1, period = 6.283185307179586")
    bodies = """
[[bodies]]
name = "planet"
gravitational_parameter = 0.75
[[bodies]]
name = "moon"
gravitational_parameter = 0.25
orbit = {about = "planet", semi_major_axis = 1, eccentricity = 0.1, periapsis = "180 deg"}
"""
    load = 'kind = "gravity_gradient"\norbit = {body = "planet"}'
    alone = run_text(config(body, rates, orbit, "end = 20\nsamples = 21"))
    among = run_text(config(body + '\nhost = "moon"', rates, load, "end = 20\nsamples = 21", more=bodies))
    # the period is rounded to double
    np.testing.assert_allclose(
        among.dataset["angular_velocity"], alone.dataset["angular_velocity"], rtol=0, atol=1e-13
    )
    np.testing.assert_allclose(among.dataset["quaternion"], alone.dataset["quaternion"], rtol=0, atol=1e-12)
    assert_sound(among)


@pytest.mark.parametrize("more", ["rotor", "core"])
def test_with_a_rotor_or_a_core(more: str) -> None:
    """The whole momentum stays, and energy is balanced."""
    body = f"principal_moments = [{', '.join(MOMENTS)}]"
    body += f"\nelasticity = {{{ELASTIC}, delay = 0.05, raised_by = []}}"
    rates, tables = f"angular_velocity = [{', '.join(RATES)}]", ""
    if more == "rotor":
        tables = '[[rotors]]\nname = "wheel"\naxis = [1, 2, 2]\nmoment = 0.1\nrate = 2\n'
    else:
        body += "\ncore = {moment = 0.1, flattening = 0.01, friction = 0.003, angular_velocity = [0, 0.1, 1]}"
    run = run_text(config(body, rates, "", "end = 50\nsamples = 51", more=tables))
    assert {"angular_momentum", "energy_balance"} <= set(run.summary["invariants"])
    assert_sound(run)


# --- sessions and sweeps ------------------------------------------------------------------------------------


def test_a_delay_that_is_long_is_told() -> None:
    run = run_text(scene(2, f"{ELASTIC}, delay = 0.2"))
    assert "delay_too_long" in run.summary["warning_codes"]


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("elastic", "said"),
    [
        ('love_number = -0.1, radius = "2 mm"', "0 (rigid) to 1.5"),
        ('love_number = 1.6, radius = "2 mm"', "0 (rigid) to 1.5"),
        ("love_number = 0.3", "radius"),
        ("love_number = 0.3, radius = 0", "a positive length"),
        ("love_number = 0.3, radius = 0.1", "up to 0.1 is allowed, since the response is linear"),
        (f"{ELASTIC}, delay = -1", "an effect comes after its cause"),
        (f"{ELASTIC}, delay = 1", "up to 1 is allowed, since what it does is a series in it"),
        (f'{ELASTIC}, delay = "1 m"', "delay"),
        (f'{ELASTIC}, raised_by = ["planets"]', 'did you mean "planet"'),
        (f'{ELASTIC}, raised_by = ["drag"]', "the source of a gravity_gradient raises"),
        (f'{ELASTIC}, raised_by = ["planet", "planet"]', "named twice"),
        (f"{ELASTIC}, lag = 1", "lag"),
    ],
)
def test_what_no_elastic_body_has_is_refused(elastic: str, said: str) -> None:
    drag = 'kind = "viscous_torque"\nname = "drag"\ncoefficients = [0, 0, 1e-6]'
    with pytest.raises(rigidsim.ConfigError) as refused:
        run_text(scene(1, elastic, loads=[MOON, drag]))
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('[integrator]\nformulation = "canonical"', "the moments of an elastic body vary"),
        ('[integrator]\nformulation = "planar"', "the moments of an elastic body vary"),
        ('[integrator]\nmethod = "closed_form"', "no closed form here"),
        ("[integrator]\nhold_invariants = true", "the moments of an elastic body vary"),
        ('[model]\nlevel = "spin_averaged"', "the moments of an elastic body vary"),
        ('[model]\nlevel = "orbit_averaged"', "the moments of an elastic body vary"),
    ],
)
def test_what_knows_rigid_bodies_alone_refuses_it(more: str, said: str) -> None:
    text = f'name = "refused"\n[body]\nprincipal_moments = [1, 2, 2.5]\nelasticity = {{{ELASTIC}}}\n'
    text += (
        "[initial]\nangular_velocity = [0, 0.1, 1]\n[[loads]]\n" + MOON + "\n[time]\nend = 1\nsamples = 2\n"
    )
    with pytest.raises(rigidsim.ConfigError) as refused:
        rigidsim.run(rigidsim.parse(text + more + "\n"))
    assert said in str(refused.value)


def test_a_rod_isnt_elastic() -> None:
    body = f'shape = "rod"\nlength = 1\nmass = 12\nelasticity = {{{ELASTIC}}}'
    with pytest.raises(rigidsim.ConfigError, match="without inertia about an axis"):
        run_text(config(body, "angular_velocity = [0.1, 0.2, 0]", MOON, "end = 1\nsamples = 2"))


@pytest.mark.parametrize(
    ("initial", "load", "said"),
    [
        ("angular_momentum = [0, 0, 1]", MOON, "angular_velocity"),
        ("angular_velocity = [0, 0, 1]\nposition = [1, 0, 0]", "", "in flight|position or velocity"),
        ('equilibrium = "relative"', MOON.replace("0.1}", "0}"), "moments vary"),
        (
            "angular_velocity = [0, 0, 1e-6]",
            'kind = "gravity_gradient"\ngravitational_parameter = "1e3 m^3/s^2"\nephemeris = "moon"',
            "analytic series",
        ),
    ],
)
def test_starts_and_sources_that_dont_suit_are_refused(initial: str, load: str, said: str) -> None:
    body = f"principal_moments = [1, 2, 2.5]\nmass = 1\nelasticity = {{{ELASTIC}}}"
    with pytest.raises(rigidsim.ConfigError) as refused:
        run_text(config(body, initial, load, "end = 1\nsamples = 2"))
    assert any(x in str(refused.value) for x in said.split("|"))
