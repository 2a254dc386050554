"""Kinks and jumps of loads: steps end on them, and the fields of both sides say how it goes on.

Truth is what each side integrates to by itself, in closed form.
"""

from itertools import pairwise, product
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import EPSILON, cases, config

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.assembly import assemble
from rigidsim.solve.problem import prepare
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.sampler import SampleReceiver
from rigidsim.solve.status import Status

SPHERE = "principal_moments = [1, 1, 1]"
REST = "angular_velocity = [0, 0, 0]"
FRICTION = 'kind = "torque"\ncomponents = ["0", "0", "-0.3*sign(wz)"]'
TILTED = "angular_velocity = [0.3, 1.2, 2]\nquaternion = [0.5, 0.4, -0.3, 0.7]"
"""Far from the singularity of the Euler angles."""


class Kept(SampleReceiver):
    """The states of all samples."""

    def __init__(self) -> None:
        self.states: list[Any] = []

    def take(self, block: SampleBlock) -> None:
        self.states += list(block.states)


def about_z(
    torque: str, *, initial: str = REST, end: str = "10", precision: str = "double", **rest: str
) -> Any:
    """A sphere under a torque about z: status, message and, in SI, the states at the end (mpf)."""
    text = config(
        SPHERE,
        initial,
        f'kind = "torque"\ncomponents = ["0", "0", "{torque}"]',
        f"end = {end}\nsamples = 2",
        f'precision = "{precision}"\n' + rest.pop("integrator", ""),
        **rest,
    )
    prepared = prepare(rigidsim.parse(text))
    kept = Kept()
    progress = assemble(prepared).driver(kept).run()
    system = prepared.system
    found = {
        name: mpmath.ldexp(prepared.precision.exact(kept.states[-1][i]), system.state_exponents[i])
        for i, name in enumerate(system.states)
        if kept.states
    }
    return progress, found


KINKED = ["abs(t - 5.3)", "sqrt((t - 5.3)^2)", "((5.3 - t)^4)^(1/4)", "max(t, 10.6 - t) - 5.3"]


@pytest.mark.parametrize(
    "case",
    cases(product(KINKED, ["double", "quadruple"]), [(KINKED[1], "double"), (KINKED[2], "double")]),
    ids=" in ".join,
)
def test_a_torque_with_a_kink_in_time(case: tuple[str, str]) -> None:
    """With a = 5.3 and b = 4.7 it turns by a^3/3 until the kink, by a^2 b/2 + b^3/6 from there on."""
    torque, precision = case
    progress, found = about_z(torque, precision=precision)
    assert progress.status is Status.FINISHED
    with mpmath.workdps(50):
        a, b = mpmath.mpf("5.3"), mpmath.mpf("4.7")
        rate = (a**2 + b**2) / 2
        angle = a**3 / 3 + a**2 / 2 * b + b**3 / 6
        # some roundings of the largest rate and angle (at most 63 rad)
        assert abs(found["wz"] - rate) < 8 * EPSILON[precision] * rate
        for name, value in (("qw", mpmath.cos(angle / 2)), ("qz", mpmath.sin(angle / 2))):
            assert abs(found[name] - value) < 8 * EPSILON[precision] * angle


@pytest.mark.parametrize("precision", cases(["double", "quadruple"], ["double"]))
def test_dry_friction_brings_the_body_to_rest_and_holds_it(precision: str) -> None:
    """w = 1 - 0.3 t until t = 10/3, after a turn by 1/0.6 rad."""
    progress, found = about_z("-0.3*sign(wz)", initial="angular_velocity = [0, 0, 1]", precision=precision)
    assert progress.status is Status.FINISHED
    assert found["wz"] == 0
    assert abs(found["work"] + mpmath.mpf(1) / 2) < 8 * EPSILON[precision]
    with mpmath.workdps(50):
        half = mpmath.mpf(10) / 12
        assert abs(found["qw"] - mpmath.cos(half)) < 16 * EPSILON[precision]
        assert abs(found["qz"] - mpmath.sin(half)) < 16 * EPSILON[precision]


def test_friction_about_three_axes_ends_in_rest() -> None:
    """Three surfaces at once; the work is minus the energy at the start."""
    friction = ", ".join(f'"-0.3*sign(w{axis})"' for axis in "xyz")
    text = config(
        "principal_moments = [1, 1.3, 2]",
        "angular_velocity = [0.5, 0.7, 1]",
        f'kind = "torque"\ncomponents = [{friction}]',
        "end = 20\nsamples = 3",
    )
    prepared = prepare(rigidsim.parse(text))
    kept = Kept()
    progress = assemble(prepared).driver(kept).run()
    assert progress.status is Status.FINISHED
    states = dict(zip(prepared.system.states, kept.states[-1], strict=True))
    energy = np.ldexp((0.25 + 1.3 * 0.49 + 2) / 2, -prepared.system.scaling.energy)
    assert max(abs(states[name]) for name in ("wx", "wy", "wz")) < 8 * EPSILON["double"]
    assert abs(states["work"] + energy) < 32 * EPSILON["double"] * energy


SIDES = [
    ("sign((t - 5)^2)", 10.0),  # touched, never crossed
    ("step(t - 2.5)*min(t, 4)", (16 - 6.25) / 2 + 24),
    ("abs(abs(t - 5) - 2)", 4 + 9.0),
    ("sign(sign(t - 3) + 0.5)", 7 - 3.0),  # an argument that jumps itself
    ("step(sin(t - 2)*(2.5 - t))", 0.5 + np.pi),  # on a surface again within the step after one
    ("1 - 0.3*abs(wx)", 10.0),  # never left
]


@pytest.mark.parametrize("case", cases(SIDES, SIDES[4:5], daily=2))
def test_each_side_integrates_by_itself(case: tuple[str, float]) -> None:
    torque, rate = case
    progress, found = about_z(torque)
    assert progress.status is Status.FINISHED
    assert abs(float(found["wz"]) - rate) < 16 * EPSILON["double"] * rate


@pytest.mark.parametrize(
    ("torque", "initial", "why"),
    [
        ("0.3*sign(wz)", REST, "isn't unique"),  # from rest to either side
        (
            "-sign(wrap(psi - 1)) - 0.3*sign(wz)*(1 + 0.1*sign(wrap(psi - 1)))",
            "angular_velocity = [0, 0, 0.5]\n" + TILTED.split("\n")[1],
            "almost no time",
        ),
    ],
)
def test_what_cannot_be_continued_ends_in_a_status_of_its_own(torque: str, initial: str, why: str) -> None:
    """Two ways to go on; and switches that accumulate: each swing is shorter by a constant factor."""
    progress, _ = about_z(torque, initial=initial, end="30")
    assert progress.status is Status.UNRESOLVED
    assert why in progress.detail
    assert "[[loads]] number 1 components[2]" in progress.detail
    assert "tanh" in progress.detail


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (config(loads=FRICTION, output="lyapunov = true"), ["[output] lyapunov", "sign(wz)", "tanh"]),
        (
            config(
                initial="angular_velocity = [0, 0, 1]\neuler_angles = [0.1, -0.3, 0.2]",
                loads='kind = "torque"\ncomponents = ["0", "0", "sin(psi)"]',
            ),
            ["[initial] euler_angles", "-0.3", "0 to pi", "zxz"],
        ),
        (
            config(more='[[events]]\nname = "a"\nexpression = "step(t - 2)*wy"'),
            ["step", "crosses zero nowhere"],
        ),
    ],
    ids=["spectrum", "other triple of angles", "event that jumps"],
)
def test_what_would_be_wrong_is_refused(text: str, words: list[str]) -> None:
    with pytest.raises(ConfigError) as refused:
        prepare(rigidsim.parse(text))
    for word in words:
        assert word in str(refused.value)


def test_a_norm_that_vanishes_is_not_passed_over() -> None:
    """About one axis sqrt(wx^2 + wy^2 + wz^2) is |wz|, whose series go on with the wrong sign; abs gives the
    motion, the norm ends where wz does.
    """
    drag = "cos(t) - 0.3*{}*wz"
    start = "angular_velocity = [0, 0, -0.5]"
    progress, _ = about_z(drag.format("sqrt(wx^2 + wy^2 + wz^2)"), initial=start)
    assert progress.status in (Status.NON_FINITE, Status.COLLAPSED)
    assert progress.time < 0.6
    progress, _ = about_z(drag.format("abs(wz)"), initial=start)
    assert progress.status is Status.FINISHED
    smooth, _ = about_z(drag.format("sqrt(1 + wx^2 + wy^2 + wz^2)"), initial=start)
    assert smooth.status is Status.FINISHED


def test_events_are_kept_where_steps_are_taken_back() -> None:
    """A pulse's edges, a torque that turns at wy = 0, and an event between: scipy's motion has them, too."""
    text = config(
        initial="angular_velocity = [0.1, 0.2, 1]",
        loads='kind = "torque"\ncomponents = ["0.1*pulse(t, 1, 2)", "-0.01*abs(wy)", "max(0, sin(3*t))*0.1"]',
        time="end = 3\nsamples = 4",
        more='[[states]]\nname = "s"\nderivative = "wz - s"\n'
        '[[events]]\nname = "half"\nexpression = "s - 0.5"',
    )
    run = rigidsim.run(rigidsim.parse(text), out=None)
    moments = np.array([1, 2, 2.5])

    def motion(t: float, y: np.ndarray) -> np.ndarray:
        w = y[:3]
        torque = [0.1 * (1 < t < 2), -0.01 * abs(w[1]), 0.1 * max(0.0, np.sin(3 * t))]
        return np.append((torque - np.cross(w, moments * w)) / moments, w[2] - y[3])

    state, crossed = np.array([0.1, 0.2, 1, 0]), []
    edges = [0, 1, np.pi / 3, 2, 2 * np.pi / 3, 3]
    for begin, end in pairwise(edges):

        def half(_: float, y: np.ndarray) -> float:
            return float(y[3] - 0.5)

        within = (begin + 1e-14, end - 1e-14)
        done = solve_ivp(motion, within, state, "DOP853", events=half, rtol=1e-12, atol=1e-13)
        state = done.y[:, -1]
        crossed += list(done.t_events[0])
    assert run.dataset["angular_velocity"].values[-1] == pytest.approx(state[:3], abs=1e-10)
    assert run.dataset["half_time"].values == pytest.approx(crossed, abs=1e-10)


def test_surfaces_are_crossed_at_loose_tolerances() -> None:
    """There a zero is found where the argument is as large as what the tolerance cuts off."""
    rates = [
        float(about_z("cos(t) - 0.5*max(wz, 0)", end="30", integrator=f"tolerance = {tolerance}\n")[1]["wz"])
        for tolerance in (1e-15, 1e-6)
    ]
    assert abs(rates[0] - rates[1]) < 1e-4  # a hundred tolerances


def test_a_second_crossing_within_a_step_is_found_where_it_is() -> None:
    """wx = t - t^2/2 is above 1/2 - 5e-11 for 2e-5 s; four roundings over its rate."""
    torque = 'kind = "torque"\ncomponents = ["1 - t", "0", "sign(wx - 0.49999999995)"]'
    prepared = prepare(rigidsim.parse(config(SPHERE, REST, torque, "end = 2\nsamples = 2")))
    kept = Kept()
    assemble(prepared).driver(kept).run()
    place = prepared.system.states.index("wz")
    rate = np.ldexp(float(kept.states[-1][place]), prepared.system.state_exponents[place])
    assert abs(rate - (4e-5 - 2)) < 4 * EPSILON["double"] / 1e-5
