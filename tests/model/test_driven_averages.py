"""Averages under torques of the body alone: means over polhodes, their start, and what forbids them."""

import math

import numpy as np
import pytest
from equations import EPS, Random, derivative, matrix
from scipy.integrate import solve_ivp
from support import config, run_text

from rigidsim import ConfigError, parse
from rigidsim.solve.problem import InitialValueProblem, prepare

MOMENTS, RATES = [1.7, 1.0, 2.0], [0.4, 0.5, 1.2]
DAMPING = [1e-4, 2e-4, 1.5e-4]
VISCOUS = 'kind = "viscous_torque"\ncoefficients = [1e-4, 2e-4, 1.5e-4]'
AS_FORMULAS = 'kind = "torque"\ncomponents = ["-1e-4*wx", "-2e-4*wy", "-1.5e-4*wz"]'
Q = Random(5).quaternion()


def prepared(
    loads: str = VISCOUS,
    *,
    rates: list[float] = RATES,
    moments: list[float] = MOMENTS,
    level: str = "spin_averaged",
    end: str = "50",
    more: str = "",
    precision: str = "double",
) -> InitialValueProblem:
    start = f"angular_velocity = {rates}\nquaternion = {Q.tolist()}"
    model = f'[model]\nlevel = "{level}"\n{more}'
    body, integrator = f"principal_moments = {moments}", f'precision = "{precision}"'
    return prepare(parse(config(body, start, loads, f"end = {end}\nsamples = 11", integrator, "", model)))


# --- means over a polhode ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.unoptimised
def test_a_viscous_torque_averages_to_the_same_by_closed_means_and_by_nodes() -> None:
    for rates in (RATES, [0.1, 1.5, 0.2]):
        closed, summed = (prepared(loads, rates=rates).system for loads in (VISCOUS, AS_FORMULAS))
        state = [float(x) for x in closed.initial]
        assert closed.states == ["sx", "sy", "sz", "axial", "transverse"]
        one, other = (np.asarray(derivative(system, np.array(state))) for system in (closed, summed))
        assert (one[:3] == 0).all()
        assert (one[3:] < 0).all()
        # sums of some hundred terms
        np.testing.assert_allclose(other[3:], one[3:], rtol=50 * EPS)


# --- the start ----------------------------------------------------------------------------------------------


def full(moments: np.ndarray, rates: list[float], damping: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Angular momentum in space, (3, n), by Euler's equations and the attitude's."""

    def change(_: float, y: np.ndarray) -> np.ndarray:
        attitude, w = y[:9].reshape(3, 3), y[9:]
        skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        turned = (-damping * w - np.cross(w, moments * w)) / moments
        return np.concatenate([(attitude @ skew).ravel(), turned])

    start = np.concatenate([matrix(Q).ravel(), rates])
    found = solve_ivp(change, (0, times[-1]), start, "DOP853", times, rtol=1e-10, atol=1e-12).y
    return np.einsum("abt,bt->at", found[:9].reshape(3, 3, -1), moments[:, None] * found[9:])


@pytest.mark.slow
def test_the_averaged_motion_starts_in_the_middle_of_the_full_one() -> None:
    """Direction and size of the momentum against means (Hann) of the full motion over some hundred turns."""
    start = f"angular_velocity = {RATES}\nquaternion = {Q.tolist()}"
    level = '[model]\nlevel = "spin_averaged"'
    body = f"principal_moments = {MOMENTS}"
    record = 'record = ["momentum_axis", "angular_momentum_norm"]'
    data = run_text(config(body, start, VISCOUS, "end = 50\nsamples = 11", "", record, level)).dataset
    times = np.linspace(0, 400, 8001)
    momentum = full(np.array(MOMENTS), RATES, np.array(DAMPING), times)
    weights = np.hanning(len(times))
    directions = momentum / np.linalg.norm(momentum, axis=0)
    true = directions[:, 0] - directions @ weights / weights.sum()
    # of second order: the torque over the momentum times rates, and what it changes by over the times
    off = directions[:, 0] - data["momentum_axis"].values[0]
    np.testing.assert_allclose(off, true, atol=0.05 * np.linalg.norm(true))
    size = np.log(np.linalg.norm(momentum, axis=0))
    fit = np.polynomial.polynomial.polyfit(times, size, 3, w=np.sqrt(weights))
    shift = size[0] - fit[0]
    assert abs(shift) > 5e-7  # so that there is something to find
    assert math.log(float(data["angular_momentum_norm"][0])) == pytest.approx(fit[0], abs=0.1 * abs(shift))


# --- what has no average ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"loads": VISCOUS, "level": "orbit_averaged"}, 'choose "spin_averaged"'),
        ({"loads": AS_FORMULAS.replace("1e-4*wx", "1e-4*wx*sin(t)")}, "a torque depends on time"),
        ({"loads": AS_FORMULAS.replace("1e-4*wx", "1e-4*qx^2")}, "nor a function of the rates in body axes"),
        ({"loads": AS_FORMULAS.replace("1e-4*wx", "1e-4*abs(wx)")}, "kink or jump"),
        ({"moments": [1, 1, 1]}, "moments are all the same"),
        (
            {"rates": [0.3, 1.2, 0.2], "end": "1e5", "loads": VISCOUS.replace("2e-4", "1e-3")},
            "near the separatrix",
        ),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_what_has_no_average_is_refused_with_the_reason(given: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigError, match=r'\[model\] level: given "(spin|orbit)_averaged", but ') as found:
        prepared(**given)  # type: ignore[arg-type]
    assert said in str(found.value)
    assert "choose" in str(found.value)


@pytest.mark.slow
def test_the_time_at_which_the_separatrix_comes_near_is_told() -> None:
    """Up to then a run goes; and the full motion leaves its axis soon after."""
    given = {"rates": [0.3, 1.2, 0.2], "loads": VISCOUS.replace("2e-4", "1e-3")}
    with pytest.raises(ConfigError, match="bring the body there after") as found:
        prepared(end="1e5", **given)  # type: ignore[arg-type]
    told = float(str(found.value).split("there after ")[1].split(" s")[0])
    assert prepared(end=str(0.99 * told), **given).system.formulation.average is not None  # type: ignore[arg-type]
    moments, damping = np.array(MOMENTS), np.array([1e-4, 1e-3, 1.5e-4])
    times = np.linspace(0, 1.4 * told, 8001)

    def change(_: float, w: np.ndarray) -> np.ndarray:
        return np.asarray((-damping * w - np.cross(w, moments * w)) / moments)

    rates = solve_ivp(change, (0, times[-1]), given["rates"], "DOP853", times, rtol=1e-8, atol=1e-10).y
    crossed = times[np.flatnonzero(np.diff(np.sign(rates[1])))]
    assert told < crossed[0] < 1.35 * told


@pytest.mark.slow
def test_a_resonance_with_a_source_is_passed_fast_or_refused() -> None:
    """A hundred times slower, it may capture."""

    def passing(slower: float) -> InitialValueProblem:
        damping = [x / slower for x in (3e-6, 2.4e-5, 2.3e-5)]
        loads = f'kind = "viscous_torque"\ncoefficients = {damping}\n[[loads]]\nkind = "gravity_gradient"\n'
        loads += "gravitational_parameter = 2.5e-5\n"
        loads += 'orbit = {semi_major_axis = 1, eccentricity = 0.044, inclination = "12.6 deg"}'
        rates, end = [0.63, 0.62, -0.46], str(19000 * slower)
        return prepared(loads, rates=rates, moments=[0.307, 1.0, 0.879], end=end)

    for slower in (1, 10):
        assert passing(slower).system.states[-2:] == ["axial", "transverse"]
    with pytest.raises(ConfigError, match=r"may be captured in a resonance.*or end the run before"):
        passing(100)
