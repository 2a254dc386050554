"""Kovalevskaya's and Goryachev-Chaplygin's constants: where they hold, and only there."""

from typing import Any

import heyoka as hy
import numpy as np
import pytest
from equations import EPS, array, matrix, prepared

PULL = 'kind = "uniform_gravity"\nacceleration = [0, 0, -2]'
TIMES = np.linspace(0, 10, 101)


def travel(system: Any) -> np.ndarray:
    """States in SI over ten seconds."""
    start = np.array([float(x) for x in system.initial])
    integrator = hy.taylor_adaptive(system.equations, start, compact_mode=True)
    states = integrator.propagate_grid(np.ldexp(TIMES, -system.scaling.time))[-1]
    return np.ldexp(states, np.array(system.state_exponents))


def constants(states: np.ndarray, frame: np.ndarray, k: float, up: np.ndarray) -> dict[str, np.ndarray]:
    """K and G in numpy, from rates and the vertical in the axes e1 (to the centre of mass), e2, e3."""
    w, g = states[:, :3] @ frame.T, up @ frame.T
    return {
        "kovalevskaya_constant": (w[:, 0] ** 2 - w[:, 1] ** 2 - k * g[:, 0]) ** 2
        + (2 * w[:, 0] * w[:, 1] - k * g[:, 1]) ** 2,
        "goryachev_chaplygin_constant": w[:, 2] * (w[:, 0] ** 2 + w[:, 1] ** 2) - k * w[:, 0] * g[:, 2],
    }


def verticals(system: Any, states: np.ndarray) -> np.ndarray:
    if "gx" in system.states:
        return states[:, 3:6]
    return np.array([matrix(q)[2] for q in states[:, 3:7]])


def named(system: Any) -> set[str]:
    return {i.name for i in system.invariants} & {"kovalevskaya_constant", "goryachev_chaplygin_constant"}


def top(ratio: float, axis: int, center: list[float], w: list[float], formulation: str) -> Any:
    """Moments ``ratio`` about two axes and 1 about ``axis``."""
    moments = [ratio] * 3
    moments[axis] = 1.0
    body = f"principal_moments = {array(moments)}\nmass = 0.5\ncenter_of_mass = {array(center)}"
    turned = np.roll(w, axis - 2)
    return prepared(
        body, f"angular_velocity = {array(turned)}\nquaternion = [0.8, 0.4, -0.2, 0.4]", PULL,
        integrator=f'formulation = "{formulation}"',
    ).system  # fmt: skip


@pytest.mark.parametrize(("formulation", "axis"), [("rates", 0), ("quaternion", 1), ("quaternion", 2)])
def test_kovalevskayas_constant_holds(formulation: str, axis: int) -> None:
    """Any axis may be that of symmetry, and the centre of mass may lie anywhere in the equatorial plane."""
    center = np.zeros(3)
    center[(axis + 1) % 3], center[(axis + 2) % 3] = 0.6, 0.8
    system = top(2.0, axis, list(center), [0.4, 0.9, 0.7], formulation)
    assert named(system) == {"kovalevskaya_constant"}
    states = travel(system)
    frame = np.array([center, np.cross(np.eye(3)[axis], center), np.eye(3)[axis]])
    values = constants(states, frame, 0.5 * 2 * 1 / 1, verticals(system, states))["kovalevskaya_constant"]
    bound = 50 * EPS * np.sqrt(200) * 10  # at most 200 steps, numbers of at most 10
    assert np.ptp(values) < bound
    assert np.ptp(states[:, axis]) > 0.1
    (found,) = [i for i in system.invariants if i.name == "kovalevskaya_constant"]
    inside = np.ascontiguousarray(np.ldexp(states, -np.array(system.state_exponents)).T)
    ours = np.ldexp(hy.cfunc(found.expressions, system.variables)(inside)[0], found.exponents[0])
    np.testing.assert_allclose(ours, values, rtol=0, atol=bound)
    assert float(found.scale) > values.max()
    assert "M g l" in found.scale_name
    assert found.units == "rad4 s-4"


def goryachev(ratio: float, axis: int, center: np.ndarray, lift: float = 0.0) -> Any:
    """Started by an angular momentum in space axes, level but for ``lift``."""
    moments = np.full(3, ratio)
    moments[axis] = 1.0
    body = f"principal_moments = {array(moments)}\nmass = 0.5\ncenter_of_mass = {array(center)}"
    initial = f"angular_momentum = [0.9, -1.4, {lift}]\nquaternion = [0.8, 0.4, -0.2, 0.4]"
    return prepared(body, initial, PULL, integrator='formulation = "quaternion"').system


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_goryachev_chaplygins_constant_holds(axis: int) -> None:
    center = np.roll([1.0, 0, 0], axis - 2)
    system = goryachev(4.0, axis, center)
    assert named(system) == {"goryachev_chaplygin_constant"}
    states = travel(system)
    frame = np.array([center, np.cross(np.eye(3)[axis], center), np.eye(3)[axis]])
    up = verticals(system, states)
    values = constants(states, frame, 1.0, up)["goryachev_chaplygin_constant"]
    bound = 50 * EPS * np.sqrt(200) * 10
    assert np.ptp(values) < bound
    (found,) = [i for i in system.invariants if i.name == "goryachev_chaplygin_constant"]
    inside = np.ascontiguousarray(np.ldexp(states, -np.array(system.state_exponents)).T)
    ours = np.ldexp(hy.cfunc(found.expressions, system.variables)(inside)[0], found.exponents[0])
    np.testing.assert_allclose(ours, values, rtol=0, atol=bound)
    assert float(found.scale) > np.abs(values).max()
    lifted = goryachev(4.0, axis, center, lift=0.1)
    assert named(lifted) == set()
    states = travel(lifted)
    values = constants(states, frame, 1.0, verticals(lifted, states))["goryachev_chaplygin_constant"]
    assert np.ptp(values) > 1e-3
