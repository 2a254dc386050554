"""Kovalevskaya's and Goryachev-Chaplygin's constants: where they hold, and only there."""

from typing import Any

import heyoka as hy
import numpy as np
import pytest
from equations import EPS, array, matrix, prepared

K, G = "kovalevskaya_constant", "goryachev_chaplygin_constant"
TIMES = np.linspace(0, 10, 101)


def top(name: str, axis: int, center: np.ndarray, formulation: str, lift: float = 0.0) -> Any:
    """Moments 2 or 4 about two axes and 1 about ``axis``; G starts level in space axes but for ``lift``."""
    moments = np.full(3, {K: 2.0, G: 4.0}[name])
    moments[axis] = 1.0
    start = f"angular_velocity = {array(np.roll([0.4, 0.9, 0.7], axis - 2))}"
    if name == G:
        start = f"angular_momentum = [0.9, -1.4, {lift}]"
    return prepared(
        f"principal_moments = {array(moments)}\nmass = 0.5\ncenter_of_mass = {array(center)}",
        f"{start}\nquaternion = [0.8, 0.4, -0.2, 0.4]",
        'kind = "uniform_gravity"\nacceleration = [0, 0, -2]',
        integrator=f'formulation = "{formulation}"',
    ).system


def followed(name: str, system: Any, axis: int, center: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States over ten seconds, and the constant in numpy, in the axes e1 (to the centre of mass), e2, e3."""
    integrator = hy.taylor_adaptive(system.equations, [float(x) for x in system.initial], compact_mode=True)
    inside = integrator.propagate_grid(np.ldexp(TIMES, -system.scaling.time))[-1]
    states = np.ldexp(inside, np.array(system.state_exponents))
    up = states[:, 3:6] if "gx" in system.states else np.array([matrix(q)[2] for q in states[:, 3:7]])
    frame = np.array([center, np.cross(np.eye(3)[axis], center), np.eye(3)[axis]])
    (a, b, c), (x, y, z) = (states[:, :3] @ frame.T).T, (up @ frame.T).T  # k = m g l / C is 1
    values = {K: (a**2 - b**2 - x) ** 2 + (2 * a * b - y) ** 2, G: c * (a**2 + b**2) - a * z}[name]
    return inside, values


@pytest.mark.parametrize(
    ("name", "formulation", "axis"),
    [(K, "rates", 0), (K, "quaternion", 1), (G, "quaternion", 0), (G, "quaternion", 2)],
)
def test_the_constant_holds(name: str, formulation: str, axis: int) -> None:
    """A body may be symmetric about any axis, Kovalevskaya's centre of mass anywhere in the equator."""
    center = np.roll([0.6, 0.8, 0] if name == K else [1.0, 0, 0], axis - 2)
    system = top(name, axis, center, formulation)
    (found,) = [i for i in system.invariants if i.name in (K, G)]
    assert found.name == name
    inside, values = followed(name, system, axis, center)
    bound = 50 * EPS * np.sqrt(200) * 10  # at most 200 steps, numbers of at most 10
    assert np.ptp(values) < bound
    function = hy.cfunc(found.expressions, system.variables)
    ours = np.ldexp(function(np.ascontiguousarray(inside.T))[0], found.exponents[0])
    np.testing.assert_allclose(ours, values, rtol=0, atol=bound)
    assert float(found.scale) > np.abs(values).max()
    if name == G:
        lifted = top(name, axis, center, formulation, lift=0.1)
        assert not {i.name for i in lifted.invariants} & {K, G}
        assert np.ptp(followed(name, lifted, axis, center)[1]) > 1e-3
