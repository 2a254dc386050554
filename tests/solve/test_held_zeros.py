"""Projection leaves alone what stands exactly where it began: a body on its intermediate axis stays there,
where a last bit put into a rate would grow exponentially; and it counts a planar angle in radians, whatever
its unit.
"""

import math
from itertools import product

import mpmath
import numpy as np
import pytest
from support import EPSILON, angle_between, cases, config, run_text

import rigidsim
from rigidsim.solve.projection import STEPS_BETWEEN

GRADIENT = 'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1}'
GRAVITY = 'kind = "uniform_gravity"\nacceleration = [0, 0, -1]'
TOP = "principal_moments = [2, 2, 1]\nmass = 1\ncenter_of_mass = [0, 0, 0.5]"
CARRIED = ("quaternion", "rotation_matrix", "euler_angles")


def held_bound(precision: str, steps: int) -> float:
    """Attitude error of a held run, rad: the wander between corrections, of which the part over the ends is
    left (``tests/solve/test_projection.py``), and the rounding of the attitude itself, at worst alike at each
    step of a steady motion (angles below 4 rad by 2 eps, half of what lies between neighbours).
    """
    return EPSILON[precision] * (STEPS_BETWEEN * math.sqrt(steps / 12) + 2 * steps)


def steps(run: rigidsim.Run) -> int:
    return int(run.summary["cost"]["steps"])


def turned(start: np.ndarray, axis: int, angles: np.ndarray) -> np.ndarray:
    """Attitudes (n, 4) of a body turned from ``start`` by angles (rad) about one of its axes, in 80 bits."""
    half = np.asarray(angles, dtype=np.longdouble) / 2
    c, s = np.cos(half), np.sin(half)
    w, *v = start.astype(np.longdouble)
    found = [w * c - v[axis] * s, None, None, None]
    for i in range(3):
        found[1 + i] = v[i] * c
    j, k = (axis + 1) % 3, (axis + 2) % 3
    found[1 + axis] += w * s
    found[1 + j] += v[k] * s
    found[1 + k] -= v[j] * s
    return np.stack(found, axis=1)


def spun(
    axis: int, rate: str, formulation: str, precision: str, hold: str, seed: int, end: float
) -> rigidsim.Run:
    """A free body of random moments and attitude that spins about one principal axis."""
    random = np.random.default_rng(seed)
    q = random.normal(size=4)
    start = (q / np.linalg.norm(q)).tolist()
    moments = np.sort(random.uniform(0.7, 1.3, 3)).tolist()
    rates = ", ".join(rate if i == axis else "0" for i in range(3))
    return run_text(
        config(
            f"principal_moments = {moments}", f"angular_velocity = [{rates}]\nquaternion = {start}",
            time=f"end = {end}\nsamples = 9",
            integrator=f'formulation = "{formulation}"\nprecision = "{precision}"\nhold_invariants = {hold}',
        )
    )  # fmt: skip


def check_spun(run: rigidsim.Run, axis: int, rate: str, precision: str) -> None:
    rates, attitude = run.dataset.angular_velocity.values, run.dataset.quaternion.values
    assert np.all(np.delete(rates, axis, axis=1) == 0)
    # corrections move a rate that no binary number is by a last bit to and fro, so that its mean is right
    assert rates[:, axis] == pytest.approx(float(rate), rel=2 * EPSILON[precision])
    if steps(run) < STEPS_BETWEEN:  # an angle that grows alone takes a single step: nothing was corrected
        return
    truth = turned(attitude[0], axis, np.longdouble(rate) * run.dataset.time.values.astype(np.longdouble))
    error = angle_between(attitude, truth.astype(float))
    assert error.max() < held_bound(precision, steps(run)) + 4 * EPSILON["double"]


AXES = list(product((0, 1, 2), CARRIED, ("double", "single")))


@pytest.mark.parametrize("case", cases(AXES, [(1, "quaternion", "double")]), ids=str)
def test_a_body_on_a_principal_axis_stays_there(case: tuple[int, str, str]) -> None:
    axis, formulation, precision = case
    check_spun(spun(axis, "1.1", formulation, precision, "true", 25 + axis, 400), axis, "1.1", precision)


INVARIANT_PLANES = {
    "planar gradient": ("principal_moments = [1, 1.75, 2]", "angular_velocity = [0, 0, 1.1]", GRADIENT,
                        CARRIED, [0, 1], "[0.8, 0, 0, 0.6]"),
    "sleeping top": (TOP, "angular_velocity = [0, 0, 1.7]", GRAVITY, CARRIED, [0, 1], "[0.8, 0, 0, 0.6]"),
    "balanced top": (TOP, "angular_velocity = [0, 0, 0]", GRAVITY, CARRIED, [0, 1, 2], "[0.8, 0, 0, 0.6]"),
    "pendulum": (TOP.replace("[2, 2, 1]", "[1.5, 2, 1]"), "angular_velocity = [1.3, 0, 0]", GRAVITY,
                 ("rates", "quaternion", "rotation_matrix", "canonical"), [1, 2], "[0.8, 0.6, 0, 0]"),
    "symmetric body": ("principal_moments = [2, 2, 1.3]", "angular_velocity = [0.3, 0.2, 0]", "",
                       CARRIED, [2], "[0.5, 0.1, -0.7, 0.3]"),
    "symmetric top": (TOP, "angular_velocity = [0.3, 0.2, 0]", GRAVITY,
                      CARRIED, [2], "[0.5, 0.1, -0.7, 0.3]"),
}  # fmt: skip


@pytest.mark.parametrize("name", cases(INVARIANT_PLANES, []))
def test_motions_in_a_plane_or_at_rest_stay_in_it(name: str) -> None:
    """What symmetry keeps at zero is exactly zero, in each formulation."""
    body, rates, load, formulations, zero, attitude = INVARIANT_PLANES[name]
    for formulation in formulations:
        for precision in ("double", *["single", "extended"] * (formulation == "quaternion")):
            run = run_text(
                config(body, f"{rates}\nquaternion = {attitude}", load, "end = 100\nsamples = 9",
                       f'formulation = "{formulation}"\nprecision = "{precision}"\nhold_invariants = true')
            )  # fmt: skip
            assert np.all(run.dataset.angular_velocity.values[:, zero] == 0), (formulation, precision)


def libration(
    offset: str, formulation: str, hold: str, end: float, moments: str = "1, 1.75, 2"
) -> rigidsim.Run:
    """A body that librates in the plane of a circular orbit, released at rest relative to the radius."""
    with mpmath.workdps(50):
        half = mpmath.mpf(offset) / 2
        c, s = (mpmath.nstr(x, 45) for x in (mpmath.cos(half), mpmath.sin(half)))
    return run_text(
        config(
            f"principal_moments = [{moments}]",
            f"angular_velocity = [0, 0, 1]\nquaternion = [{c}, 0, 0, {s}]",
            GRADIENT, f"end = {end}\nsamples = 9",
            f'formulation = "{formulation}"\nhold_invariants = {hold}',
        )
    )  # fmt: skip


def libration_error(run: rigidsim.Run, offset: str, moments: str = "1, 1.75, 2") -> float:
    """Largest attitude error, rad, against the pendulum's equation in elliptic functions: for x the angle
    from the radius, I3 x'' = -(3/2) (I2 - I1) sin 2x.
    """
    with mpmath.workdps(40):
        first, second, third = (mpmath.mpf(m) for m in moments.split(","))
        rate, modulus = mpmath.sqrt(3 * (second - first) / third), mpmath.sin(mpmath.mpf(offset))
        quarter, largest = mpmath.ellipk(modulus**2), 0.0
        for time, q in zip(run.dataset.time.values, run.dataset.quaternion.values, strict=True):
            phase = mpmath.fmod(rate * mpmath.mpf(time) + quarter, 4 * quarter)
            angle = mpmath.asin(modulus * mpmath.ellipfun("sn", phase, m=modulus**2)) + mpmath.mpf(time)
            c, s = mpmath.cos(angle / 2), mpmath.sin(angle / 2)
            largest = max(largest, abs(float(2 * (c * mpmath.mpf(q[3]) - s * mpmath.mpf(q[0])))))
    return largest


def test_a_libration_near_its_equilibrium_is_held() -> None:
    """There the gradient of the Jacobi constant vanishes, but for the angle's unit of 2^20 rad, in which it
    would be of order one, and the constant's own rounding would move the angle. What is left is a random walk
    of angle and spin, which are rounded at each step.
    """
    run = libration("9.5e-7", "planar", "true", 1e4)
    assert libration_error(run, "9.5e-7") < 4 * EPSILON["double"] * math.sqrt(steps(run))
