"""Growth of tangent vectors beside members that run side by side: no bit of the motion moves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_batch_families import FREE, ORBIT, PLANAR, TORQUE, swept
from test_batch_lanes import blocks_of, by_member

import rigidsim
from rigidsim.solve.batch.lanes import BatchEngine, LaneResults, recommended_width

RATES = {"initial.angular_velocity[2]": "uniform = [0.3, 2.2], count = 9"}


def growing(text: str) -> str:
    """The same with the growth recorded, between others."""
    return text.replace('["angular_velocity", ', '["angular_velocity", "tangent_growth", ')


def motions(text: str, axes: dict[str, str], **options: float) -> dict[int, Any]:
    """Bits of all that is recorded of members but the growth, which is apart; steps and status."""
    found = {}
    for member, (values, *rest) in by_member(blocks_of(swept(text, axes), **options)).items():
        growth = values.pop("tangent_growth", None)
        found[member] = ({name: table.tobytes() for name, table in values.items()}, rest), growth
    return found


@pytest.mark.parametrize(
    ("text", "axes"),
    [
        (PLANAR, RATES),
        pytest.param(FREE, RATES, marks=pytest.mark.slow),
        pytest.param(PLANAR.replace("samples = 5", "samples = 2"), RATES, marks=pytest.mark.slow),
        pytest.param(ORBIT, RATES | {"body.principal_moments[0]": "uniform = [0.5, 1], count = 9"},
                     marks=pytest.mark.slow),
        pytest.param(TORQUE, {"parameters.k": "uniform = [0.05, 0.3], count = 9"}, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_the_motion_has_the_same_bits_with_and_without(text: str, axes: dict[str, str]) -> None:
    without, along = motions(text, axes), motions(growing(text), axes)
    assert len(along) == 9
    for member, (bits, growth) in along.items():
        assert bits == without[member][0]
        assert growth.shape == (len(growth), 1)
        assert np.isfinite(growth).all()
    sweep = swept(growing(text), axes)
    single = rigidsim.run(sweep.experiment_of(4), changes={"output.estimate": False}, out=None).dataset
    np.testing.assert_allclose(along[4][1][:, 0], single.tangent_growth.values, rtol=0, atol=1e-9)


def test_one_integrator_does_for_both_only_where_it_may(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of planar members: those of large vectors are run without, and all where bits differ."""
    taken: list[tuple[int, int]] = []
    plain = BatchEngine.run
    otherwise = False

    def counted(self: BatchEngine, initial: np.ndarray, *arguments: Any) -> LaneResults:
        taken.append(initial.shape)
        lanes = plain(self, initial, *arguments)
        if otherwise and initial.shape == tried:  # as a compiler may round beside other equations
            return replace(lanes, states=np.nextafter(lanes.states, np.inf))
        return lanes

    whole, tried = (7, 9), (5, recommended_width())  # angle, spin, an orbit's place, work; the vector's two
    monkeypatch.setattr(BatchEngine, "run", counted)
    usual = motions(growing(PLANAR), RATES)
    assert taken == [whole, tried]
    taken.clear()
    growth = np.array([g[:, 0] for _, g in usual.values()]).max(axis=1)
    some = motions(growing(PLANAR), RATES, unfelt=np.exp(np.median(growth)) * 2.0**-900)
    assert some.keys() == usual.keys()
    assert taken[0] == whole
    assert 0 < taken[2][1] < 9
    # vectors that steps know of tell nothing about the code
    assert taken[1] == (5, min(tried[1], 9 - taken[2][1]))
    taken.clear()
    motions(growing(PLANAR), RATES, at_once=1)
    blocks = [min(tried[1], 9 - first) for first in range(0, 9, tried[1])]
    assert taken == [(7, blocks[0]), tried, *((7, size) for size in blocks[1:])]  # tried with the first alone
    otherwise = True
    taken.clear()
    again = motions(growing(PLANAR), RATES)
    assert taken == [whole, tried, (5, 9)]
    for member, (bits, growth) in again.items():
        assert bits == usual[member][0]
        assert (growth == usual[member][1]).all()
