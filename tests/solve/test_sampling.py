"""Samples lie where they were asked for, however they are asked for."""

from __future__ import annotations

import numpy as np
import pytest
from support import run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

SPIN = """
name = "spin"
[body]
principal_moments = [1, 2, 3]
[initial]
angular_velocity = [0.5, 0.25, 1]
[time]
"""


def times(text: str, precision: str = "double") -> np.ndarray:
    prepared = prepare(rigidsim.parse(SPIN + text + f'\n[integrator]\nprecision = "{precision}"'))
    clock = prepared.clock
    return np.ldexp(clock.internal(0, clock.count).astype(float), clock.exponent)


def test_every_and_samples_mean_the_same_grid() -> None:
    assert np.array_equal(times("end = 100\nevery = 0.1"), times("end = 100\nsamples = 1001"))
    assert times("end = 1.05\nevery = 0.1")[-1] == 1.0  # an end off the grid isn't sampled


def test_a_list_is_kept_as_written() -> None:
    assert times("times = [0, 0.1, 0.25, 7]").tolist() == [0, 0.1, 0.25, 7]
    assert times('times = ["1 h", "1 d"]').tolist() == [3600, 86400]


def test_blocks_of_the_grid_are_the_grid() -> None:
    prepared = prepare(rigidsim.parse(SPIN + "end = 3\nsamples = 1000"))
    whole = prepared.clock.internal(0, 1000)
    pieces = [prepared.clock.internal(i, min(i + 77, 1000)) for i in range(0, 1000, 77)]
    assert np.array_equal(np.concatenate(pieces), whole)
    assert prepared.clock.at(999) == whole[999]


@pytest.mark.parametrize("precision", ["single", "double", "extended", "quadruple"])
@pytest.mark.parametrize(
    "grid", ["end = 3\nsamples = 1000", "start = -2\nend = 1e4\nevery = 0.0007", "times = [0, 0.1, 7]"]
)
def test_one_sample_alone_is_the_one_of_the_block(grid: str, precision: str) -> None:
    clock = prepare(rigidsim.parse(SPIN + grid + f'\n[integrator]\nprecision = "{precision}"')).clock
    for index in {0, 1, 2, clock.count // 3, clock.count - 1}:
        [expected] = clock.internal(index, index + 1)
        assert clock.at(index) == expected


@pytest.mark.parametrize("start", ["0", "1e6", "-50"])
def test_the_motion_begins_at_start(start: str) -> None:
    text = SPIN + f"start = {start}\nend = {float(start) + 10}\nsamples = 11"
    ours = run_text(text, 'name="a"').dataset
    plain = run_text(SPIN + "start = 0\nend = 10\nsamples = 11", 'name="b"').dataset
    # an autonomous scene doesn't care; sample times of 1e6 s are rounded to 1e-10 s
    assert np.abs(ours["quaternion"].values - plain["quaternion"].values).max() < 1e-9
    assert float(ours["time"][0]) == float(start)


def test_samples_that_a_precision_can_not_tell_apart_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"\[time\].*samples .* are closer together than single"):
        times("start = 1e6\nend = 1000001\nevery = 0.01", "single")
    assert len(times("start = 1e6\nend = 1000001\nevery = 0.01", "double")) == 101


@pytest.mark.parametrize("integrator", ["", 'method = "closed_form"', "hold_invariants = true"])
def test_the_motion_begins_at_start_and_not_at_the_first_sample(integrator: str) -> None:
    text = SPIN + "{}\n[integrator]\n" + integrator
    late = run_text(text.format("times = [12.5, 25]"), 'name="a"').dataset
    grid = run_text(text.format("end = 25\nsamples = 3"), 'name="b"').dataset
    np.testing.assert_array_equal(late["quaternion"], grid["quaternion"][1:])
    before = run_text(text.format("start = -12.5\ntimes = [0, 12.5]"), 'name="c"').dataset
    # the same motion on a clock that is 12.5 s behind: times are exact in both
    assert np.abs(before["quaternion"].values - grid["quaternion"].values[1:]).max() < 1e-14


def test_one_sample_only() -> None:
    run = run_text(SPIN + "times = [5]")
    assert run.dataset.sizes["time"] == 1
    assert run.status == "finished"
