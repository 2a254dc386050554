"""A gravity gradient at a loose tolerance: twelve products, the same motion, and where that isn't chosen."""

from __future__ import annotations

import math

import heyoka as hy
import numpy as np
import pytest
from equations import CLOSE, derivative, prepared
from support import angle_between, config

import rigidsim
from rigidsim.model.paired_products import even_order
from rigidsim.model.system import System
from rigidsim.scene.rotations import rotation_matrix
from rigidsim.solve.assembly import assemble

BODY = "principal_moments = [1, 1.75, 2]"
SPIN = "angular_velocity = [0.4, 0.9, 0.3]\nquaternion = [0.5, 0.1, -0.3, 0.7]"
LOOSE = "tolerance = 1e-8"
ORBIT = "inclination = 0.7, ascending_node = 2, mean_anomaly = 1"


def load(elements: str = ORBIT, strength: float = 0.04) -> str:
    orbit = f"{{semi_major_axis = 1{', ' if elements else ''}{elements}}}"
    return f'kind = "gravity_gradient"\ngravitational_parameter = {strength}\norbit = {orbit}'


def products(system: System, tolerance: float) -> int:
    """Of two things that vary, in one evaluation of the series: heyoka's decomposition."""
    initial = [float(x) for x in system.initial]
    engine = hy.taylor_adaptive(system.equations, initial, tol=tolerance, compact_mode=True)
    count = 0
    for term, _ in engine.decomposition:
        text = str(term)
        varying = [name for name in text.strip("()").split(" * ") if name.startswith("u_")]
        count += (" * " in text and len(varying) == 2) or "**" in text or "square" in text
    return count


def test_less_than_half_the_products_of_the_quaternion() -> None:
    paired = prepared(BODY, SPIN, load(), integrator=LOOSE).system
    plain = prepared(BODY, SPIN, load(), integrator=f'{LOOSE}\nformulation = "quaternion"').system
    assert "ux" in paired.states
    assert "pw" in plain.states
    assert products(paired, 1e-8) == 12
    assert products(plain, 1e-8) == 26


@pytest.mark.parametrize("elements", [ORBIT, "period = 40"])  # of Kepler's third law, and another
def test_the_equations_are_eulers_and_poissons(elements: str) -> None:
    """Written out in numpy, at a random attitude."""
    w, q = np.array([0.4, 0.9, 0.3]), np.array([0.5, 0.1, -0.3, 0.7])
    start = f"angular_velocity = {w.tolist()}\nquaternion = {q.tolist()}"
    system = prepared(BODY, start, load(elements), integrator=LOOSE).system
    state = np.ldexp([float(x) for x in system.initial], system.state_exponents)
    moments, n, s2 = np.array([1, 1.75, 2]), 0.2 if elements == ORBIT else 2 * math.pi / 40, 0.12
    s = math.sqrt(s2)
    r, f = state[3:6] / np.ldexp(s, system.scaling.time), state[6:9] * n / s
    node, tilt, along = (2.0, 0.7, 1.0) if elements == ORBIT else (0.0, 0.0, 0.0)

    def turn(axis: int, angle: float) -> np.ndarray:
        half = [math.cos(angle / 2), 0.0, 0.0, 0.0]
        half[axis] = math.sin(angle / 2)
        return np.array(rotation_matrix(half))

    frame = turn(3, node) @ turn(1, tilt) @ turn(3, along)
    body = np.array(rotation_matrix((q / np.linalg.norm(q)).tolist())).T @ frame
    np.testing.assert_allclose([r, f], body.T[:2], rtol=0, atol=CLOSE)
    changed = derivative(system, state)
    torque = np.cross(moments * w, w) + 3 * 0.04 * np.cross(r, moments * r)
    np.testing.assert_allclose(changed[:3], torque / moments, rtol=0, atol=CLOSE)
    unit = np.ldexp(s, system.scaling.time)
    np.testing.assert_allclose(changed[3:6] / unit, np.cross(r, w) + n * f, rtol=0, atol=CLOSE)
    np.testing.assert_allclose(changed[6:9] * n / s, np.cross(f, w) - n * r, rtol=0, atol=CLOSE)
    assert changed[9] == 0.0


def test_a_run_has_the_attitude_that_the_quaternions_equations_give() -> None:
    """At 1e-9 and some 200 steps; the tight run is the truth. What a step may be wrong by is the tolerance,
    of states of the order one, r is u / s, and errors of the rates grow with the time.
    """
    text = config(BODY, SPIN, load(), "end = 100\nsamples = 201", "tolerance = 1e-9")
    run = rigidsim.run(rigidsim.parse(text, overrides=["output.estimate=true"]), out=None)
    true = rigidsim.run(rigidsim.parse(text, overrides=['integrator.tolerance="auto"']), out=None)
    assert "stride" in run.summary["states"]
    assert "stride" not in true.summary["states"]
    one, other = run.dataset, true.dataset
    apart = angle_between(one["quaternion"].values, other["quaternion"].values)
    assert 0 < apart.max() <= run.summary["accuracy"]["estimated_attitude_error"]
    assert apart.max() < 1e-9 * run.summary["cost"]["steps"] * 100
    assert (np.einsum("ij,ij->i", one["quaternion"], other["quaternion"]) > 0).all()
    np.testing.assert_allclose(one["angular_velocity"], other["angular_velocity"], rtol=0, atol=2e-7)
    assert float(abs(one["jacobi_constant_drift"]).max()) < 1e-7
    assert float(abs(one["orthogonality_defect_drift"]).max()) < 1e-7


@pytest.mark.parametrize(
    ("loads", "integrator", "more"),
    [
        (load(), "", {}),
        (load(), "tolerance = 1e-14", {}),
        (load(), f'{LOOSE}\nformulation = "quaternion"', {}),
        (load(), f"{LOOSE}\nhold_invariants = true", {}),
        (load(""), 'tolerance = 1e-5\nprecision = "single"', {}),
        (load("eccentricity = 0.1"), LOOSE, {}),
        (load(strength=1e-5), LOOSE, {}),
        (load("period = 4"), LOOSE, {}),
        (load() + '\n[[loads]]\nkind = "viscous_torque"\ncoefficients = [0.1, 0, 0]', LOOSE, {}),
        (load() + '\n[[events]]\nname = "half"\nexpression = "qw"', LOOSE, {}),
        (load(), LOOSE, {"body": "inertia_tensor = [[1, 0.1, 0], [0.1, 1.75, 0], [0, 0, 2]]"}),
    ],
    ids=[
        "auto", "tight", "quaternion", "held", "single", "eccentric", "slow", "period", "damped", "event",
        "tensor",
    ],
)  # fmt: skip
def test_elsewhere_it_is_not_chosen(loads: str, integrator: str, more: dict[str, str]) -> None:
    system = prepared(more.get("body", BODY), SPIN, loads, integrator=integrator).system
    assert not {"ux", "stride"} & set(system.states)


def test_a_body_with_two_equal_moments_spins_about_the_third() -> None:
    system = prepared("principal_moments = [1, 1, 2]", SPIN, load(), integrator=LOOSE).system
    state = np.ldexp([float(x) for x in system.initial], system.state_exponents)
    assert derivative(system, state)[2] == 0.0


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 3e-8, 1e-8, 1e-11, 1e-13])
def test_orders_are_even_and_steps_no_longer_than_the_tolerance_allows(tolerance: float) -> None:
    """The error of a step is that of the order, e^(2 - 2 p), times the factor."""
    series, factor = even_order(tolerance)
    order = math.ceil(1 - math.log(series) / 2)
    assert order % 2 == 0
    assert math.log2(factor) == round(math.log2(factor)) >= 0
    assert math.exp(2 - 2 * order) * factor <= tolerance * (1 + CLOSE)
    assert order - 2 < 1 - math.log(tolerance) / 2 <= order


def test_the_engine_has_that_order() -> None:
    problem = prepared(BODY, SPIN, load(), integrator=LOOSE)
    assert assemble(problem).stepper.integrator.order == 12
