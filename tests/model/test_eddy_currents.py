"""Eddy currents: torque (M (w x B)) x B on a conductor that turns in a magnetic field."""

import math

import numpy as np
import pytest
from equations import array, matrix
from scipy.integrate import solve_ivp
from support import config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

FIELD = np.array([1.5, -0.7, 0.9])
TENSOR = np.array([0.03, 0.01, 0.02])
START = "angular_velocity = [0.4, -0.7, 0.9]\nquaternion = [0.3, -0.5, 0.2, 0.75]"
OF_TENSOR = f"magnetic_tensor = {array(TENSOR)}\nfield = {array(FIELD)}"
SPHERE = 'conductivity = "3e7 S/m"\nradius = "30 cm"\nfield = [0, 0, "30 uT"]'


def text(load: str, end: float = 20.0, start: str = START, more: str = "") -> str:
    load = f'kind = "eddy_currents"\n{load}'
    return config(
        "principal_moments = [1, 1.5, 2]", start, load, f"end = {end}\nsamples = 41", more=more, name="spin"
    )


def momentum_rates(inertia: np.ndarray, tensor: np.ndarray, field: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Derivatives of angular momentum in space axes and rotation matrix: another form of the equations."""
    momentum, r = y[:3], y[3:12].reshape(3, 3)
    w = r @ ((r.T @ momentum) / inertia)
    currents = r @ (tensor * (r.T @ np.cross(w, field)))
    return np.concatenate([np.cross(currents, field), (np.cross(w, r.T).T).ravel()])


def start_of(inertia: np.ndarray, w: np.ndarray, q: np.ndarray) -> np.ndarray:
    r = matrix(q / np.linalg.norm(q))
    return np.concatenate([r @ (inertia * w), r.ravel()])


@pytest.mark.parametrize(
    ("precision", "error"), [("double", 1e-12), pytest.param("extended", 1e-15, marks=pytest.mark.slow)]
)
def test_a_spin_across_the_field_falls_exponentially(precision: str, error: float) -> None:
    """A LAGEOS-like sphere: rate exp(-t / T) with T = I / k B^2, for a solid one and for a shell."""
    for wall, of_wall in (("", 0.0), ('thickness = "1 cm"\n', 0.29)):
        body = 'shape = "sphere"\nmass = "407 kg"\nradius = "30 cm"'
        load = f'kind = "eddy_currents"\n{wall}{SPHERE}'
        scene = config(body, 'angular_velocity = ["0.01 rad/s", 0, 0]', load, 'end = "10 day"\nsamples = 11')
        scene = scene.replace("[integrator]", f'[integrator]\nprecision = "{precision}"')
        run = run_text(scene)
        assert run.summary["warnings"] == []
        inertia = 0.4 * 407 * 0.3**2
        damping = 2 * math.pi / 15 * 3e7 * (0.3**5 - of_wall**5) * 30e-6**2
        time, w = run.dataset["time"].values, run.dataset["angular_velocity"].values
        assert np.exp(-damping * time[-1] / inertia) < 0.9
        # rounding of this formula itself, in double: some units in the last place
        assert np.abs(w[:, 0] / (0.01 * np.exp(-damping / inertia * time)) - 1).max() <= max(error, 2e-15)
        assert np.abs(w[:, 1:]).max() == 0


@pytest.mark.slow
def test_it_agrees_with_another_integrator_of_other_equations() -> None:
    run = run_text(text(OF_TENSOR, end=300.0))
    assert run.summary["warnings"] == []
    inertia = np.array([1, 1.5, 2])
    y = start_of(inertia, np.array([0.4, -0.7, 0.9]), np.array([0.3, -0.5, 0.2, 0.75]))
    times = run.dataset["time"].values
    found = solve_ivp(
        lambda _, y: momentum_rates(inertia, TENSOR, FIELD, y),
        (0, 300), y, method="DOP853", t_eval=times, rtol=1e-13, atol=1e-15,
    ).y  # fmt: skip
    momentum = run.dataset["angular_momentum"].values
    assert np.abs(momentum - found[:3].T).max() <= 1e-11
    across = np.linalg.norm(np.cross(momentum, FIELD), axis=1)
    assert across[-1] < 0.1 * across[0]
    along = momentum @ FIELD / np.linalg.norm(FIELD)
    assert np.abs(along - along[0]).max() <= 1e-13
    assert list(run.summary["invariants"]) == ["energy_balance", "angular_momentum_field", "quaternion_norm"]


def test_beside_a_magnet_in_the_same_field_the_momentum_along_it_is_kept() -> None:
    for field, kept in ((array(FIELD), True), ("[1, 0, 0]", False)):
        magnet = f'[[loads]]\nkind = "magnetic_dipole"\nmoment = [0.1, 0.2, 0.3]\nfield = {field}\n'
        found = run_text(text(OF_TENSOR, more=magnet)).summary["invariants"]
        assert ("angular_momentum_field" in found) == kept


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ("field = [1, 0, 0]", "given none; exactly one of conductivity, magnetic_tensor"),
        ("field = [1, 0, 0]\nconductivity = 1\nradius = 1\nthickness = 2", "thickness: given 2; more than 0"),
        ("field = [1, 0, 0]\nmagnetic_tensor = [1, 1, 1]\nradius = 1", "given radius with magnetic"),
    ],
)
def test_nonsense_is_refused(load: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        prepare(rigidsim.parse(text(load)))
    assert message in str(caught.value)
