"""Elastic bodies: by equations of their own, closed forms and limits; what is conserved; what is refused."""

import numpy as np
import pytest
from elastic_bodies import Delayed
from support import config, matrices, run_text, same_bits

import rigidsim

MOMENTS, RATES = ["1", "1.0004", "1.001"], ["0.01", "-0.02", "1.05"]
STRENGTH = 0.3 * 0.002**5 / 6.67430e-11
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


# --- against equations of another form ----------------------------------------------------------------------


@pytest.mark.parametrize(("delay", "within"), [(0, 1e-11), pytest.param(0.01, 4e-8, marks=pytest.mark.slow)])
def test_without_delay_and_with_one_up_to_its_third_order(delay: float, within: float) -> None:
    """To the other integrator's 1e-13 of each step, or to (2 tau)^3 / 6 of the distortion, whose frequency is
    2.
    """
    turning = MOON.replace("0.1}", "0.1, inclination = 0.4, node_rate = -0.3}")
    run = run_text(scene(1, f"{ELASTIC}, delay = {delay}", samples=3, loads=turning))
    moments, begun = ([float(x) for x in given] for given in (MOMENTS, RATES))
    truth = Delayed(moments, STRENGTH, delay, begun[2], 1.0, 1.0, 0.1, tilt=0.4, node=-0.3)
    rates, attitudes, distortions = truth.followed(begun, run.dataset["time"].values)
    np.testing.assert_allclose(run.dataset["angular_velocity"], rates, rtol=0, atol=within)
    turned = matrices(run.dataset["quaternion"].values)
    np.testing.assert_allclose(turned, attitudes, rtol=0, atol=20 * within)
    found = run.dataset["inertia_distortion"].values
    flat = [distortions[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    np.testing.assert_allclose(found, np.transpose(flat), rtol=0, atol=within)
    assert_sound(run)


# --- limits -------------------------------------------------------------------------------------------------


def test_a_love_number_of_zero_is_the_rigid_body_bit_for_bit() -> None:
    rigid = scene(20, elastic="")
    same_bits(run_text(rigid), run_text(scene(20, 'love_number = 0, radius = "2 mm", delay = 0.01')))


FIXED, CIRCLE = "position = [0, 1, 0.3]", "orbit = {semi_major_axis = 1}"


@pytest.mark.parametrize(
    ("source", "more", "kept"),
    [
        (CIRCLE, "", {"jacobi_constant"}),
        ("", ", delay = 0.05", {"energy_balance", "angular_momentum", "angular_momentum_norm"}),
        pytest.param(
            FIXED, ", delay = 0.05", {"energy_balance", "angular_momentum_source"}, marks=pytest.mark.slow
        ),
        # tides alone aren't a minimum of any energy, so that none is claimed to be conserved
        pytest.param(CIRCLE, ", spin = false", {"energy_balance"}, marks=pytest.mark.slow),
    ],
)
def test_what_is_conserved_is_found_and_kept(source: str, more: str, kept: set[str]) -> None:
    load = f'kind = "gravity_gradient"\ngravitational_parameter = 1\n{source}' if source else ""
    run = run_text(scene(20, ELASTIC + more, loads=load))
    assert {name for name, row in run.summary["invariants"].items() if not row["numerical"]} == kept
    assert_sound(run)


# --- what tides do in the long run --------------------------------------------------------------------------

SPINDLE = 'principal_moments = [0.999, 0.999, 1]\nelasticity = {love_number = 0.3, radius = "2 mm", '


def test_a_fast_rotator_is_braked_as_mignard_found() -> None:
    """On a circle 3 k2 G M'^2 R^5 tau (w - n) / a^6 (Mignard 1979, The Moon and the Planets 20, 301: constant
    delay; Murray & Dermott 1999, section 4.9, with a lag of (w - n) tau).
    """
    delay, spin = 0.001, 3.0
    text = config(
        body=SPINDLE + f"delay = {delay}}}", initial=f"angular_velocity = [0, 0, {spin}]",
        loads=MOON.replace("eccentricity = 0.1", "eccentricity = 0"), time="end = 50\nsamples = 11",
    )  # fmt: skip
    data = run_text(text).dataset
    momentum = data["angular_momentum"].values[:, 2]
    slope = (momentum[-1] - momentum[0]) / 50
    expected = -3 * STRENGTH * delay * (spin - 1)
    # the third order of the delay, (2 (w - n) tau)^2 / 6, and what the spin has lost meanwhile
    assert slope == pytest.approx(expected, rel=1e-5 + abs(expected) * 50 / (spin - 1))


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
    for t, r, slope in zip(data["time"].values, matrices(data["quaternion"].values), change, strict=False):
        x = r.T @ truth.source(t)
        d = np.linalg.norm(x)
        power.append(-1.5 * np.sum((np.outer(x, x) / d**5 - np.eye(3) / (3 * d**3)) * slope))
    expected = 10.5 * STRENGTH * delay * e**2
    # further powers of e^2 (a factor of some tens), and the spin that the torque changes
    assert np.mean(power) == pytest.approx(expected, rel=2e-3)
    assert data["tidal_power"].values[:-1].mean() == pytest.approx(expected, rel=2e-3)
    # Fourier's sums take the spin, which the torque changes, for periodic
    np.testing.assert_allclose(data["tidal_power"][:-1], power, rtol=0, atol=1e-4 * np.abs(power).max())


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("elastic", "said"),
    [
        ('love_number = -0.1, radius = "2 mm"', "0 (rigid) to 1.5"),
        ("love_number = 0.3, radius = 0.1", "up to 0.1 is allowed, since the response is linear"),
        (f"{ELASTIC}, delay = -1", "zero or more is allowed"),
        (f'{ELASTIC}, raised_by = ["planets"]', 'did you mean "planet"'),
        (f'{ELASTIC}, raised_by = ["drag"]', "the source of a gravity_gradient raises"),
    ],
)
def test_what_no_elastic_body_has_is_refused(elastic: str, said: str) -> None:
    drag = 'kind = "viscous_torque"\nname = "drag"\ncoefficients = [0, 0, 1e-6]'
    with pytest.raises(rigidsim.ConfigError) as refused:
        run_text(scene(1, elastic, loads=[MOON, drag]))
    assert said in str(refused.value)
