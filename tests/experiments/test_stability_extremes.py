"""The study of extremes: random scenes are never wrong in silence, and it sees one that is."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from experiments.extremes import judging
from experiments.extremes.random_scenes import random_case


@pytest.mark.slow
@settings(max_examples=15, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_random_extremes_are_never_wrong_in_silence(data: st.DataObject) -> None:
    def uniform(low: float, high: float) -> float:
        return data.draw(st.floats(low, high))

    scene, column, precision, hold = random_case(uniform)
    verdict = judging.judge(scene, column, precision, hold=hold)
    assert verdict.kind in ("right", "announced", "refused"), verdict.line
