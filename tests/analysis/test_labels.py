"""Lines are called what they are: in band, folded, ambiguous, and not at all where nothing fits."""

from __future__ import annotations

import math

import pytest

from rigidsim.analysis.labels import Known, Label, combinations, label

YEAR, MONTH, NODE = 2 * math.pi / 365.25, 2 * math.pi / 27.3217, -2 * math.pi / 6798.38
KNOWN = [Known("year", YEAR), Known("month", MONTH), Known("node", NODE)]


def folded(frequency: float, nyquist: float) -> float:
    return frequency - 2 * nyquist * round(frequency / (2 * nyquist))


def test_combinations_are_complete_and_the_simplest_come_first() -> None:
    vectors = combinations(3)
    orders = abs(vectors).sum(axis=1)
    assert (orders[1:] >= orders[:-1]).all()
    # lattice points of the octahedron of radius n: (2n + 1)(2n^2 + 2n + 3)/3
    assert len(vectors) == 33 * (2 * 16**2 + 2 * 16 + 3) // 3


@pytest.mark.parametrize("real", [False, True])
def test_a_line_in_band_is_its_simplest_combination(real: bool) -> None:
    found = label(2 * MONTH + NODE, 1e-12, KNOWN, math.pi, real=real)
    assert found == Label((0, 2, 1), "2 month + node", 0, ())


@pytest.mark.parametrize("real", [False, True])
def test_a_folded_line_is_unfolded_through_the_known_frequencies(real: bool) -> None:
    nyquist = math.pi / 20
    seen = folded(2 * MONTH, nyquist)
    found = label(abs(seen) if real else seen, 1e-12, KNOWN, nyquist, real=real)
    sign = -1 if real and seen < 0 else 1
    assert found.multipliers == (0, 2 * sign, 0)
    assert found.folds * 2 * nyquist + (abs(seen) if real else seen) == pytest.approx(
        2 * MONTH * sign, rel=1e-12
    )


def test_what_fits_two_frequencies_is_not_unfolded() -> None:
    # a spin of one turn more a year than days: once a day it looks like the year
    spin = Known("spin", 2 * math.pi + YEAR)
    found = label(YEAR, 1e-9, [*KNOWN, spin], math.pi, real=False)
    assert found.folds == 0
    assert found.text == "year"
    assert found.doubtful == ("spin",)
    # and what only the spin could be is unfolded, where the year isn't known
    alone = label(YEAR, 1e-9, [KNOWN[2], spin], math.pi, real=False)
    assert alone.text == "spin"
    assert alone.folds == 1
    assert not alone.doubtful


def test_signals_in_space_know_nothing_of_a_spin_about_an_axis_of_symmetry() -> None:
    spin = Known("spin", 2 * math.pi + YEAR, where="body")
    assert not label(YEAR, 1e-9, [KNOWN[0], spin], math.pi, real=False).doubtful
    assert label(YEAR, 1e-9, [KNOWN[0], spin], math.pi, real=False, in_body=True).doubtful == ("spin",)
