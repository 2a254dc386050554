"""The study of what accuracy costs: its choices are right, and one of its scenes is measured."""

from __future__ import annotations

import pytest

from experiments import precision_tradeoff as study
from rigidsim.accuracy.setting import Setting

A, B, C = Setting("single"), Setting("double"), Setting("extended")


@pytest.fixture(scope="module")
def points() -> study.Points:
    return study.measure_scene("asymmetric_top", to=1e3, processes=1)


@pytest.mark.slow(29)
def test_a_scene_is_measured_at_each_horizon(points: study.Points) -> None:
    assert list(points) == [1e2, 1e3]
    short, long = ({p.setting: p for p in points[h]} for h in (1e2, 1e3))
    assert Setting("quadruple") in short
    assert Setting("quadruple") not in long  # not measured so far, and not extrapolated
    default = study.DEFAULT
    assert short[default].cost == long[default].cost == 1.0
    assert all(long[s].error >= short[s].error for s in long)  # the largest so far
    closed = Setting("double", method="closed_form")
    assert long[closed].cost == pytest.approx(short[closed].cost / 10)  # as many samples in ten times the run
    assert long[closed].error < 1e-14  # it doesn't grow: some eps
    assert all(check.passed for check in study.checks({"asymmetric_top": points}))
