"""User-defined states (``[[states]]``) against closed forms, and in the equations against numpy."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from equations import CLOSE, Random, derivative
from support import EPSILON, config, loaded, run_text, same_bits, wide

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare


def state(name: str, derivative: str, initial: Any = 0, unit: str = "1") -> str:
    quoted = f'"{initial}"' if isinstance(initial, str) else initial
    lines = f'name = "{name}"\nderivative = "{derivative}"\ninitial = {quoted}\nunit = "{unit}"'
    return f"[[states]]\n{lines}\n"


# --- closed forms -------------------------------------------------------------------------------------------

SPIN = {"body": "principal_moments = [1, 1, 2]", "initial": "angular_velocity = [0.3, 0.1, 0.5]"}
FILTER = state("held", "(wz - held)/(4 s)", "0.1 rad/s", "rad/s")
PENDULUM = state("swing", "swung", "0.1", "rad") + state("swung", "-9*swing", 0, "rad/s")


@pytest.mark.parametrize("precision", ["single", "double", "extended"])
def test_a_filter_and_a_pendulum_are_their_closed_forms(precision: str) -> None:
    """Over twenty periods; the error of a pendulum's phase grows as that of some hundred steps."""
    given = config(more=FILTER + PENDULUM, time="end = 40\nsamples = 41", **SPIN)
    data = loaded(run_text(given, f'integrator.precision="{precision}"'))
    t = np.longdouble(1) * np.arange(41)
    epsilon = max(EPSILON[precision], 2.0**-63)
    tenth = np.longdouble(1) / 10
    held = np.longdouble("0.5") + (tenth - np.longdouble("0.5")) * np.exp(-t / 4)
    for name, exact in (
        ("held", held),
        ("swing", tenth * np.cos(3 * t)),
        ("swung", -3 * tenth * np.sin(3 * t)),
    ):
        error = np.abs(wide(data, name) - exact).max()
        assert error < 500 * epsilon, name


# --- laws against equations of another formulation ----------------------------------------------------------

LOOSE = state("lagged", "(wx - lagged)/2", 0, "rad/s") + state("slosh", "sloshing", "0.05", "rad")
LOOSE += state("sloshing", "-4*slosh - sloshing/8 - wy/16", 0, "rad/s")
DAMPER = 'kind = "torque"\ncomponents = ["-lagged/1024", "slosh/512", "0"]'


def test_a_damper_and_slosh_are_in_the_equations() -> None:
    system = prepare(rigidsim.parse(config(loads=DAMPER, more=LOOSE))).system
    random, moments = Random(6), np.array([1, 2, 2.5])
    for _ in range(5):
        w, own = random.vector(), dict(zip(("lagged", "slosh", "sloshing"), random.vector(), strict=True))
        given = dict(zip(("wx", "wy", "wz", "qw", "qx", "qy", "qz"), [*w, *random.quaternion()], strict=True))
        state = np.array([(given | own).get(name, 0.0) for name in system.states])
        found = dict(zip(system.states, derivative(system, state), strict=True))
        torque = np.array([-own["lagged"] / 1024, own["slosh"] / 512, 0])
        turned = (torque - np.cross(w, moments * w)) / moments
        expected = dict(zip(("wx", "wy", "wz"), turned, strict=True)) | {
            "lagged": (w[0] - own["lagged"]) / 2,
            "slosh": own["sloshing"],
            "sloshing": -4 * own["slosh"] - own["sloshing"] / 8 - w[1] / 16,
        }
        for name, value in expected.items():
            assert found[name] == pytest.approx(value, abs=10 * CLOSE), name


def test_a_law_that_reads_a_limited_state_switches_in_its_derivative() -> None:
    """u' = min(1, u) - 2 from u = 3: -1 until u = 1, at t = 2, and then u - 2: u = 2 - exp(t - 2)."""
    more = state("u", "min(1, u) - 2", 3) + '[[events]]\nname = "gone"\nexpression = "u"\n'
    data = loaded(run_text(config(more=more, time="end = 4\nsamples = 9")))
    t = data["time"].values
    exact = np.where(t < 2, 3 - t, 2 - np.exp(t - 2))
    np.testing.assert_allclose(data["u"].values, exact, rtol=0, atol=1e-14)
    np.testing.assert_allclose(data["gone_time"].values, [2 + np.log(2)], rtol=0, atol=1e-14)


@pytest.mark.slow
@pytest.mark.unoptimised
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
    "twice": (2 * FILTER, 'two states are named "held"'),
    "unit that isn't SI": (state("a", "wz", 0, "deg"), 'states are in SI: "rad" is allowed'),
    "initial value's dimension": (
        state("a", "wz", "3 s", "rad"),
        'given a value in s; "s" is not a unit of the dimension asked for, which is rad',
    ),
    "the quaternion's sign": (state("a", "qx"), "changes with the sign of the quaternion"),
}


@pytest.mark.parametrize("case", list(BAD))
def test_what_makes_no_sense_is_refused(case: str) -> None:
    more, message = BAD[case]
    with pytest.raises(ConfigError, match=message):
        run_text(config(more=more))


def test_a_state_with_a_pole_ends_the_run_there() -> None:
    """a' = a^2 from 1: a = 1 / (1 - t). Its unit isn't that of the pole, where steps would pass over it."""
    run = run_text(config(more=state("a", "a^2", 1), time="end = 3\nsamples = 61"))
    assert run.status == "stopped: non-finite state"
    data = loaded(run)
    t = data["time"].values
    assert 0.9 < t[-1] < 1.01
    before = t < 0.99
    np.testing.assert_allclose(data["a"].values[before], 1 / (1 - t[before]), rtol=1e-12)
