"""Elastic bodies: by equations of their own, closed forms and limits; what is conserved; what is refused."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
from elastic_bodies import Delayed, followed, strength
from support import config, run_text, same_bits, wide
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
        ("double", "rotation_matrix", 50, 5e-13),
        ("double", "euler_angles", 50, 5e-13),
        ("single", "quaternion", 50, 2e-4),
        ("quadruple", "quaternion", 20, 1e-18),
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


# --- with a delay -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("delay", "within"), [(0.01, 4e-8), (0.0025, 6e-10)])
def test_with_a_delay_up_to_its_third_order(delay: float, within: float) -> None:
    """The bound falls with the delay to the third: (2 tau)^3 / 6 of the distortion, whose frequency is 2."""
    run = run_text(scene(30, f"{ELASTIC}, delay = {delay}"))
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
    kept = set() if load else {"angular_momentum", "angular_momentum_norm"}
    assert found == {"energy_balance", *kept} | ({"angular_momentum_source"} & found)
    assert_sound(run)
