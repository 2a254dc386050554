"""Moments that vary with kinks, by DOP853 that begins anew at each; axes and angles of bodies that change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import config, run_estimated, run_text
from test_rotors import matrices

Side = Callable[[float, np.ndarray], float]
START = "angular_velocity = [0.1, 0.2, 1]"


def state(name: str, derivative: str) -> str:
    return f'[[states]]\nname = "{name}"\nderivative = "{derivative}"\n'


def bent(
    moments: Callable[[float, np.ndarray, Sequence[float]], Sequence[float]],
    change: Callable[[float, np.ndarray, np.ndarray, Sequence[float]], float],
    kinks: Sequence[Side],
    end: float,
) -> np.ndarray:
    """Rotation matrix (3, 3) at the end by R' = R [w]x, with a constant momentum in space and one state of
    its own, from kink to kink.

    Args:
        moments: of (t, own, sides); change: of the own state, of (t, own, w, sides).
        kinks: functions of (t, own) that vanish at kinks; their signs are the sides.
    """
    sides = [np.sign(kink(1e-9, np.zeros(1))) for kink in kinks]
    start = np.asarray(moments(0.0, np.zeros(1), sides)) * [0.1, 0.2, 1.0]

    def flow(t: float, y: np.ndarray) -> np.ndarray:
        r, own = y[:9].reshape(3, 3), y[9:]
        w = (r.T @ start) / np.asarray(moments(t, own, sides))
        turn = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.append((r @ turn).ravel(), change(t, own, w, sides))

    def watched(kink: Side) -> Any:
        found = lambda t, y: kink(t, y[9:])  # noqa: E731
        found.terminal = True
        return found

    events = [watched(kink) for kink in kinks]
    options: Any = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15}
    t, y = 0.0, np.append(np.eye(3).ravel(), 0.0)
    while t < end:
        away = solve_ivp(flow, (t, min(t + 1e-3, end)), y, **options)  # from the kink it stands on
        part = solve_ivp(flow, (away.t[-1], end), away.y[:, -1], events=events, **options)
        t, y = part.t[-1], part.y[:, -1]
        for n, times in enumerate(part.t_events):
            sides[n] *= -1 if len(times) else 1
    return y[:9].reshape(3, 3)


BENT: dict[str, tuple[str, str, Any, Any, list[Side]]] = {
    "abs of time": (
        'principal_moments = ["1 + 0.2*abs(sin(t))", 2, 2.5]',
        "",
        lambda t, s, sides: [1 + 0.2 * sides[0] * np.sin(t), 2, 2.5],
        lambda t, s, w, sides: 0.0,
        [lambda t, s: np.sin(t)],
    ),
    "min and max of an own state": (
        'principal_moments = ["1 + max(-0.1, min(a, 0.1))", 2, 2.5]',
        state("a", "0.3*wx - 0.1*a"),
        lambda t, s, sides: [1 + (0.1 if sides[0] > 0 else -0.1 if sides[1] < 0 else s[0]), 2, 2.5],
        lambda t, s, w, sides: 0.3 * w[0] - 0.1 * s[0],
        [lambda t, s: s[0] - 0.1, lambda t, s: s[0] + 0.1],
    ),
    "a switch in a state's derivative": (
        'principal_moments = [1, 2, "2.5 - drawn/4"]',
        state("drawn", "pulse(t, 3, 8)/5 - 0.1*abs(drawn - 0.3)"),
        lambda t, s, sides: [1, 2, 2.5 - s[0] / 4],
        lambda t, s, w, sides: (0.2 if sides[0] > 0 > sides[1] else 0.0) - 0.1 * sides[2] * (s[0] - 0.3),
        [lambda t, s: t - 3, lambda t, s: t - 8, lambda t, s: s[0] - 0.3],
    ),
}


def text(case: str, samples: int = 3) -> str:
    body, more, *_ = BENT[case]
    return config(body=body, initial=START, time=f"end = 30\nsamples = {samples}", more=more)


@pytest.mark.parametrize("case", list(BENT))
def test_moments_with_kinks(case: str) -> None:
    """30 rad; the truth has an rtol of 1e-13 in some hundred steps."""
    *_, moments, change, kinks = BENT[case]
    run = run_estimated(text(case))
    wrong = np.abs(matrices(run.dataset)[-1].astype(float) - bent(moments, change, kinks, 30.0)).max()
    assert wrong <= 2e-12
    assert run.summary["accuracy"]["estimated_attitude_error"] <= 1e-11
    assert all(row["largest_drift"] <= row["bound"] for row in run.summary["invariants"].values())


@pytest.mark.parametrize("case", list(BENT))
def test_errors_announced_of_moments_with_kinks(case: str) -> None:
    """At a loose tolerance, where what is announced can be compared with 80 bits."""
    loose = run_estimated(text(case), "integrator.tolerance=1e-8")
    fine = run_text(text(case), 'integrator.precision="extended"')
    wrong = float(np.abs(matrices(loose.dataset)[-1] - matrices(fine.dataset)[-1]).max())
    assert wrong <= 3 * loose.summary["accuracy"]["estimated_attitude_error"]


@pytest.mark.parametrize(
    ("precision", "formulation", "within"),
    [
        ("single", "quaternion", 1e-4), ("double", "rotation_matrix", 2e-12),
        ("double", "euler_angles", 2e-12), ("quadruple", "quaternion", 2e-12),  # within the truth
    ],
)  # fmt: skip
def test_moments_with_kinks_in_every_precision_and_formulation(
    precision: str, formulation: str, within: float
) -> None:
    *_, moments, change, kinks = BENT["min and max of an own state"]
    chosen = [f'integrator.precision="{precision}"', f'integrator.formulation="{formulation}"']
    run = run_text(text("min and max of an own state"), *chosen)
    assert (
        np.abs(matrices(run.dataset)[-1].astype(float) - bent(moments, change, kinks, 30.0)).max() <= within
    )


# --- axes and angles ----------------------------------------------------------------------------------------

ASKED = ["andoyer_momenta", "andoyer_angles", "nutation_angle", "wobble_angle", "polar_motion"]


def turn(angle: np.ndarray, axis: int) -> np.ndarray:
    """Matrices (n, 3, 3) that turn vectors by angles about an axis."""
    found = np.zeros((len(angle), 3, 3), dtype=angle.dtype)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    found[:, axis, axis] = 1
    found[:, i, i] = found[:, j, j] = np.cos(angle)
    found[:, j, i] = np.sin(angle)
    found[:, i, j] = -np.sin(angle)
    return found


@pytest.mark.parametrize("figure", ["largest", "z"])
def test_axes_and_angles_of_a_body_that_changes(figure: str) -> None:
    """Each by its definition, with the moments of the time: the largest at the start is the second later."""
    record = f"record = {[*ASKED, 'quaternion', 'angular_velocity', 'principal_moments']}"
    given = config(
        body='principal_moments = [1, "2 + 0.9*sin(t/20)^2", "2.5 - t/60"]',
        initial="angular_velocity = [0.1, 0.2, 1]\neuler_angles = [0.3, 0.8, 0.4]",
        time="end = 40\nsamples = 81",
        output=record,
        more=f'[frame]\nfigure_axis = "{figure}"\n',
    )
    data = run_text(given).dataset
    moments, rates = data["principal_moments"].values, data["angular_velocity"].values
    attitudes = matrices(data).astype(float)
    assert (moments[:, 1] > moments[:, 2]).any()
    body = moments * rates
    size = np.linalg.norm(body, axis=1)
    space = np.einsum("nij,nj->ni", attitudes, body)
    named = data["andoyer_momenta"].values
    np.testing.assert_allclose(named, np.stack([body[:, 2], size, space[:, 2]], axis=1), atol=1e-13)
    around, g, h = data["andoyer_angles"].values.T
    tilt, wobble = (np.arccos(named[:, n] / size) for n in (2, 0))
    built = turn(h, 2) @ turn(tilt, 0) @ turn(g, 2) @ turn(wobble, 0) @ turn(around, 2)
    np.testing.assert_allclose(built, attitudes, atol=1e-12)
    away = np.arctan2(np.hypot(body[:, 0], body[:, 1]), body[:, 2])
    np.testing.assert_allclose(data["nutation_angle"].values, away, atol=1e-13)
    np.testing.assert_allclose(data["wobble_angle"].values, away, atol=1e-13)  # of the axis at the start
    off = np.hypot(rates[:, 0], rates[:, 1]) > np.abs(rates[:, 2])
    assert off.any() or figure == "z"
    pole = np.where(off[:, None], np.nan, rates[:, :2] / rates[:, 2:])
    np.testing.assert_allclose(data["polar_motion"].values, pole, atol=1e-13)
