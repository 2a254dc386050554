"""States of one's own (``[[states]]``) against closed forms, and against equations in momentum and rotation
matrix that are integrated in 80 bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from space_motions import LONG, Motion
from support import EPSILON, angle_between, config, loaded, matrices, run_text, same_bits, wide

import rigidsim
from rigidsim import ConfigError


def state(name: str, derivative: str, initial: Any = 0, unit: str = "1") -> str:
    quoted = f'"{initial}"' if isinstance(initial, str) else initial
    lines = f'name = "{name}"\nderivative = "{derivative}"\ninitial = {quoted}\nunit = "{unit}"'
    return f"[[states]]\n{lines}\n"


def body(**more: Any) -> Motion:
    """The body of ``support.config`` with further states; its quaternion is that of its Euler angles."""
    half = [LONG(x) / 20 for x in (2, 11, 7)]  # of 0.2, 1.1 and 0.7
    (c, s), plus, minus = (np.cos(half[1]), np.sin(half[1])), half[0] + half[2], half[0] - half[2]
    q = [c * np.cos(plus), s * np.cos(minus), s * np.sin(minus), c * np.sin(plus)]
    return Motion((1, 2, "2.5"), ("0.3", 1, "0.5"), q, **more)


def assert_same_motion(data: Any, rows: np.ndarray, names: Sequence[str], bound: float) -> None:
    found = matrices(data["quaternion"].values)
    np.testing.assert_allclose(found, rows[:, 3:12].reshape(-1, 3, 3).astype(float), rtol=0, atol=bound)
    for place, name in enumerate(names, start=12):
        np.testing.assert_allclose(data[name].values, rows[:, place].astype(float), rtol=0, atol=bound)


# --- closed forms -------------------------------------------------------------------------------------------

SPIN = {"body": "principal_moments = [1, 1, 2]", "initial": "angular_velocity = [0.3, 0.1, 0.5]"}
FILTER = state("held", "(wz - held)/(4 s)", "0.1 rad/s", "rad/s")
PENDULUM = state("swing", "swung", "0.1", "rad") + state("swung", "-9*swing", 0, "rad/s")


@pytest.mark.parametrize("precision", ["single", "double", "extended"])
def test_a_filter_and_a_pendulum_are_their_closed_forms(precision: str) -> None:
    """Over twenty periods; the error of a pendulum's phase grows as that of some hundred steps."""
    given = config(more=FILTER + PENDULUM, time="end = 40\nsamples = 41", **SPIN)
    data = loaded(run_text(given, f'integrator.precision="{precision}"'))
    t = LONG(1) * np.arange(41)
    epsilon = max(EPSILON[precision], 2.0**-63)
    tenth = LONG(1) / 10
    held = LONG("0.5") + (tenth - LONG("0.5")) * np.exp(-t / 4)
    for name, exact in (
        ("held", held),
        ("swing", tenth * np.cos(3 * t)),
        ("swung", -3 * tenth * np.sin(3 * t)),
    ):
        error = np.abs(wide(data, name) - exact).max()
        assert error < 500 * epsilon, name


@pytest.mark.parametrize("formulation", ["rates", "rotation_matrix", "canonical"])
def test_formulations_carry_them(formulation: str) -> None:
    record = 'record = ["angular_velocity", "held", "swing"]'
    given = config(more=FILTER + PENDULUM, time="end = 10\nsamples = 11", output=record, **SPIN)
    data = loaded(
        run_text(given, f'integrator.formulation="{formulation}"', 'integrator.euler_sequence="xyz"')
    )
    t = np.arange(11)
    np.testing.assert_allclose(data["held"].values, 0.5 - 0.4 * np.exp(-t / 4), rtol=0, atol=1e-14)
    np.testing.assert_allclose(data["swing"].values, 0.1 * np.cos(3 * t), rtol=0, atol=1e-14)
    assert data["swing"].attrs["units"] == "rad"
    assert "swung" not in data


# --- laws against equations of another formulation ----------------------------------------------------------

LOOSE = state("lagged", "(wx - lagged)/2", 0, "rad/s") + state("slosh", "sloshing", "0.05", "rad")
LOOSE += state("sloshing", "-4*slosh - sloshing/8 - wy/16", 0, "rad/s")
DAMPER = 'kind = "torque"\ncomponents = ["-lagged/1024", "slosh/512", "0"]'


def test_a_damper_and_slosh_follow_the_motion_over_a_thousand_radians() -> None:
    motion = body(lagged=0, slosh="0.05", sloshing=0)
    (x, y, _), (lagged, slosh, sloshing) = motion.rates, motion.more.values()
    equations = motion.equations(
        [-lagged / 1024.0, slosh / 512.0, hy.expression(0.0)],
        lagged=(x - lagged) / 2.0, slosh=sloshing, sloshing=-4.0 * slosh - sloshing / 8.0 - y / 16.0,
    )  # fmt: skip
    times = np.linspace(0, 1000, 41)
    rows = motion.followed(equations, times)
    given = config(loads=DAMPER, more=LOOSE, time="end = 1000\nsamples = 41")
    data = loaded(run_text(given))
    assert np.linalg.norm(data["angular_velocity"].values, axis=1).min() > 0.9  # rad/s: a thousand radians
    assert_same_motion(data, rows, ["lagged", "slosh", "sloshing"], 1e-12)


POINTING = """[parameters]
k = 0.5
d = 0.75
i = 0.0625
most = 0.25
"""
LAW = "max(-most, min(most, -k*2*qw*q{0} - d*w{0} - i*sum_{0}))"
POINTED = 'kind = "torque"\ncomponents = [' + ", ".join(f'"{LAW.format(x)}"' for x in "xyz") + "]"
SUMS = "".join(state(f"sum_{x}", f"2*qw*q{x}", 0, "s") for x in "xyz")


def saturated(times: np.ndarray) -> np.ndarray:
    """The pointing law by pieces: where a component u meets a limit, it is held there until u comes back."""
    motion = body(sx=0, sy=0, sz=0)
    m, names = motion.matrix, ["sx", "sy", "sz"]
    # 2 qw q_k is half of an antisymmetric part of R
    parts = [(m[2][1] - m[1][2]) / 2.0, (m[0][2] - m[2][0]) / 2.0, (m[1][0] - m[0][1]) / 2.0]
    laws = [
        -0.5 * part - 0.75 * w - 0.0625 * motion.more[name]
        for part, w, name in zip(parts, motion.rates, names, strict=True)
    ]
    torque = [hy.par[2 * n] * law + hy.par[2 * n + 1] for n, law in enumerate(laws)]
    equations = motion.equations(torque, **dict(zip(names, parts, strict=True)))
    limits = [(n, side) for n in range(3) for side in (0.25, -0.25)]
    events = [hy.t_event(laws[n] - side, fp_type=LONG) for n, side in limits]
    engine = motion.engine(equations, t_events=events)
    value = hy.cfunc(laws, vars=[v for v, _ in equations], fp_type=LONG, compact_mode=True)
    modes = [int(x > 0.25) - int(x < -0.25) for x in value(engine.state)]

    def switch() -> None:
        for n, mode in enumerate(modes):
            engine.pars[2 * n] = LONG(mode == 0)
            engine.pars[2 * n + 1] = LONG(mode) / 4

    switch()
    rows = []
    for time in times:
        while (outcome := engine.propagate_until(LONG(time))[0]) != hy.taylor_outcome.time_limit:
            n, side = limits[-int(outcome.value) - 1]
            modes[n] = 0 if modes[n] else int(np.sign(side))
            switch()
        rows.append(engine.state.copy())
    return np.array(rows)


def test_a_pointing_law_with_an_integral_and_a_limit_follows_its_pieces() -> None:
    times = np.linspace(0, 60, 61)
    given = config(loads=POINTED, more=POINTING + SUMS, time="end = 60\nsamples = 61")
    assert_same_motion(loaded(run_text(given)), saturated(times), ["sum_x", "sum_y", "sum_z"], 1e-13)


def test_a_law_that_reads_a_limited_state_switches_in_its_derivative() -> None:
    """u' = min(1, u) - 2 from u = 3: -1 until u = 1, at t = 2, and then u - 2: u = 2 - exp(t - 2)."""
    more = state("u", "min(1, u) - 2", 3) + '[[events]]\nname = "gone"\nexpression = "u"\n'
    data = loaded(run_text(config(more=more, time="end = 4\nsamples = 9")))
    t = data["time"].values
    exact = np.where(t < 2, 3 - t, 2 - np.exp(t - 2))
    np.testing.assert_allclose(data["u"].values, exact, rtol=0, atol=1e-14)
    np.testing.assert_allclose(data["gone_time"].values, [2 + np.log(2)], rtol=0, atol=1e-14)


def test_a_recorded_state_that_nothing_reads_changes_the_motion_within_rounding() -> None:
    """Step control sees it, so that steps may differ; whether it grows beyond all others or stays tiny."""
    plain = loaded(run_text(config(time="end = 100\nsamples = 11")))
    for more in (state("grows", "1e6 + wx", 0, "rad"), state("tiny", "1e-9*wx - tiny", 0), FILTER):
        data = loaded(run_text(config(more=more, time="end = 100\nsamples = 11")))
        apart = angle_between(data["quaternion"].values, plain["quaternion"].values).max()
        assert apart < 1e-13  # rad: rounding in some hundred steps of two motions, at 1.2 rad/s


def test_a_run_with_a_state_that_grows_is_prolonged_bit_for_bit(tmp_path: Path) -> None:
    """Its unit doesn't depend on the end."""
    more = state("grows", "1e6 + wx", 0, "rad") + state("held", "sin(t)")
    done = run_text(config(more=more, time="end = 10\nsamples = 11"), out=tmp_path / "short")
    longer = rigidsim.resume(done.folder.path, until="160")
    same_bits(longer, run_text(config(more=more, time="end = 160\nsamples = 161")))


def test_only_what_is_read_or_recorded_is_carried() -> None:
    more = FILTER + state("more", "held", 0, "rad") + state("apart", "1", 0)
    record = 'record = ["angular_velocity", "more"]'
    plan = rigidsim.plan(rigidsim.parse(config(more=more, output=record))).as_dict()
    assert plan["states"] == ["wx", "wy", "wz", "held", "more"]
    why = {row["states"]: row["why"] for row in plan["reasons"]}
    assert (why["held"], why["more"]) == ("state more reads it", "recorded")
    assert "apart" in {row["what"] for row in plan["left_out"]}


BAD = {
    "name of the body's": (state("wx", "1"), 'given "wx", which expressions use already'),
    "name of a variable": (state("energy", "1"), "as a variable that can be recorded"),
    "name of another state": (state("pace", "exp(-((t - 1)/0.01)^2)"), "another state of the motion"),
    "twice": (2 * FILTER, 'two states are named "held"'),
    "unit that isn't SI": (state("a", "wz", 0, "deg"), 'states are in SI: "rad" is allowed'),
    "derivative's dimension": (state("a", "wz", 0, "m"), 'in "1/s", where "m/s" is needed'),
    "initial value's dimension": (
        state("a", "wz", "3 s", "rad"),
        'given a value in s; "s" is not a unit of the dimension asked for, which is rad',
    ),
    "no value at the start": (state("a", "1/a"), "no finite value at the start"),
    "the quaternion's sign": (state("a", "qx"), "changes with the sign of the quaternion"),
    "unknown name": (state("a", "b"), 'unknown name "b".*a, pi, e; x, y, z, vx'),
}


@pytest.mark.parametrize("case", list(BAD))
def test_what_makes_no_sense_is_refused(case: str) -> None:
    more, message = BAD[case]
    with pytest.raises(ConfigError, match=message):
        run_text(config(more=more))


def test_what_can_t_carry_them_says_so() -> None:
    with pytest.raises(ConfigError, match=r"state held of .* has no closed form"):
        run_text(config(more=FILTER), 'integrator.method="closed_form"')


def test_a_state_with_a_pole_ends_the_run_there() -> None:
    """a' = a^2 from 1: a = 1 / (1 - t). Its unit isn't that of the pole, where steps would pass over it."""
    run = run_text(config(more=state("a", "a^2", 1), time="end = 3\nsamples = 61"))
    assert run.status == "stopped: non-finite state"
    data = loaded(run)
    t = data["time"].values
    assert 0.9 < t[-1] < 1.01
    before = t < 0.99
    np.testing.assert_allclose(data["a"].values[before], 1 / (1 - t[before]), rtol=1e-12)
