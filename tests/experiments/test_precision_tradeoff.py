"""The study of what accuracy costs: its choices are right, and one of its scenes is measured."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments import precision_tradeoff as study
from experiments.precision_tradeoff import Point
from rigidsim.accuracy.setting import Setting

A, B, C = Setting("single"), Setting("double"), Setting("extended")
MADE_UP = [Point(B, 1e-12, 1.0), Point(A, 1e-4, 0.2), Point(C, 1e-11, 12.0), Point(C, 1e-16, 10.0)]


def test_the_front_leaves_out_what_is_beaten() -> None:
    assert study.front(MADE_UP) == [MADE_UP[1], MADE_UP[0], MADE_UP[3]]


def test_the_cheapest_keeps_the_accuracy() -> None:
    assert study.cheapest(MADE_UP, 1e-3) == MADE_UP[1]
    assert study.cheapest(MADE_UP, 1e-12) == MADE_UP[0]
    assert study.cheapest(MADE_UP, 1e-15) == MADE_UP[3]
    assert study.cheapest(MADE_UP, 1e-20) is None


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


@pytest.mark.slow(29)
def test_figure_and_table(points: study.Points, tmp_path: Path) -> None:
    scenes = {"asymmetric_top": points}
    assert study.draw(scenes, tmp_path).stat().st_size > 50_000
    rows = study.markdown(scenes).splitlines()
    assert len(rows) == 4
    assert all(row.startswith("| free asymmetric body |") for row in rows[2:])
    assert "quadruple" not in rows[3]
