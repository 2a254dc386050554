"""Kinks and jumps beside a kernel or a table: steps end on surfaces as well as where pieces begin.

The truth carries the momentum and the rotation matrix in space axes by DOP853, which is begun anew at each
surface, found by bisection, and at each edge of the kernel's blocks.
"""

from collections.abc import Callable

import de421
import numpy as np
import pytest
from jplephem.ephem import Ephemeris
from scipy.integrate import DOP853
from support import cases, config, matrices, run_text

DAY, UNIT = 86400.0, 1e5
MOMENTS = np.array([8.79e34, 8.7920e34, 8.7955e34])
RATES, QUATERNION = np.array([1e-8, -2e-8, 1.3e-5]), np.array([0.9, 0.1, 0.2, 0.3])
SCENE = config(
    'principal_moments = [8.79e34, 8.7920e34, 8.7955e34]\nhost = "moon"',
    "angular_velocity = [1e-8, -2e-8, 1.3e-5]\nquaternion = [0.9, 0.1, 0.2, 0.3]",
    [
        'kind = "gravity_gradient"\nname = "earth"\nsource = "earth"',
        'kind = "torque"\nframe = "body"\ncomponents = [0, "{torque}", 0]',
    ],
    'epoch = "1969-07-20T12:00:00 TDB"\nend = "40 day"\nevery = "1 day"',
    output='record = ["quaternion", "angular_velocity"]',
    more='[ephemeris]\nkernel = "de421"',
)
KERNEL = Ephemeris(de421)
Argument = Callable[[float, np.ndarray, np.ndarray], float]
# by time, direction of the Earth in body axes and rates: a surface's argument; by that and a side: the torque
CASES: dict[str, tuple[str, Argument, Callable[[float, float], float]]] = {
    "kink in time": (
        "1e22*abs(sin(t/3e5))", lambda t, u, w: np.sin(t / 3e5), lambda x, side: 1e22 * side * x
    ),
    "kink in direction": (
        "3e22*max(uy_earth, 0)", lambda t, u, w: u[1], lambda x, side: 3e22 * x * (side > 0)
    ),
    "jump": ("2e22*sign(uy_earth)", lambda t, u, w: u[1], lambda x, side: 2e22 * side),
    "kink in rates": (
        "1e28*abs(wy + 2e-8*cos(t/3e5))",
        lambda t, u, w: w[1] + 2e-8 * np.cos(t / 3e5),
        lambda x, side: 1e28 * side * x,
    ),
}  # fmt: skip


def place(seconds: float) -> np.ndarray:
    """The Earth seen from the Moon, m, by jplephem."""
    return -1000 * np.asarray(KERNEL.position("moon", 2440423.0, seconds / DAY))[:, 0]


def truth(name: str, days: float) -> tuple[np.ndarray, int]:
    """The rotation matrix at the end, and how many surfaces were crossed."""
    _, argument, torque = CASES[name]
    strength = KERNEL.GMB * KERNEL.EMRAT / (1 + KERNEL.EMRAT) * (KERNEL.AU * 1000) ** 3 / DAY**2
    side, crossed = 1.0, 0

    def parts(t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
        matrix, x = y[:9].reshape(3, 3), place(t * UNIT)
        r, rates = np.linalg.norm(x), (matrix.T @ y[9:] * 1e29) / MOMENTS
        u = matrix.T @ (x / r)
        return matrix, rates, u, 3 * strength / r**3 * np.cross(u, MOMENTS * u), argument(t * UNIT, u, rates)

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        matrix, rates, _, pull, x = parts(t, y)
        given = pull + np.array([0.0, torque(x, side), 0.0])
        turned = matrix @ np.array(
            [[0, -rates[2], rates[1]], [rates[2], 0, -rates[0]], [-rates[1], rates[0], 0]]
        )
        return np.concatenate([turned.ravel(), matrix @ given / 1e29]) * UNIT

    y = np.concatenate([matrices(QUATERNION).ravel(), np.zeros(3)])
    y[9:] = y[:9].reshape(3, 3) @ (MOMENTS * RATES) / 1e29
    t = 0.0
    first = parts(0.0, y)[-1]
    side = 1.0 if first > 0 or (first == 0 and name == "kink in time") else -1.0
    for end in [*np.arange(1.5, days, 4), days]:
        until = end * DAY / UNIT
        while t < until:
            solver = DOP853(slope, t, y, until, rtol=1e-13, atol=1e-15, max_step=0.5)
            while solver.status == "running":
                solver.step()
                if side * parts(solver.t, solver.y)[-1] < 0:
                    root, dense = solver.t, solver.dense_output()
                    begin = solver.t_old
                    for _ in range(60):
                        middle = (begin + root) / 2
                        beyond = side * parts(middle, dense(middle))[-1] < 0
                        begin, root = (begin, middle) if beyond else (middle, root)
                    # the step is taken again up to there, since its end lies beyond the kink
                    again = DOP853(slope, solver.t_old, dense(solver.t_old), root, rtol=1e-13, atol=1e-15)
                    while again.status == "running":
                        again.step()
                    t, y, side, crossed = root, again.y, -side, crossed + 1
                    break
            else:
                t, y = until, solver.y
    return y[:9].reshape(3, 3), crossed


@pytest.mark.parametrize("name", cases(CASES, ["kink in direction"]))
def test_steps_end_at_kinks_and_at_edges(name: str) -> None:
    matrix, crossed = truth(name, 40)
    assert crossed >= 2
    run = run_text(SCENE.format(torque=CASES[name][0]), estimate=True)
    error = matrix - matrices(run.dataset["quaternion"].values[-1])
    assert np.abs(error).max() < 1e-11
    assert run.summary["accuracy"]["estimated_attitude_error"] < 1e-12
