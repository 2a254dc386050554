"""Lines and secular parts of made-up signals: exact ones to the last digit, noisy ones within errors."""

import math
from typing import Any

import mpmath
import numpy as np
import pytest
from support import cases

from rigidsim.analysis.decomposition import Decomposition, decompose
from rigidsim.analysis.exponentials import SignalSamples, Sum
from rigidsim.analysis.labels import Known, Label, label

CONTEXT = mpmath.MPContext()
CONTEXT.prec = 220
ROOT2, ROOT3 = CONTEXT.sqrt(2), CONTEXT.sqrt(3)


def samples(total: Sum, *, real: bool, parts: int) -> SignalSamples:
    """A sum sampled by recurrence, in so many doubles a number, with the digits that a run would have."""
    count, one = total.count, 1 << 220

    def fixed(x: Any) -> int:
        return int(CONTEXT.ldexp(x, 220))

    columns = [[0] * count, [0] * count]
    for frequency, amplitude in zip(total.frequencies, total.amplitudes, strict=True):
        step = CONTEXT.expjpi(2 * frequency)
        value = amplitude * CONTEXT.expjpi(frequency * (1 - count))
        c, s, x, y = (fixed(v) for v in (step.real, step.imag, value.real, value.imag))
        for n in range(count):
            columns[0][n] += 2 * x if real else x
            columns[1][n] += 0 if real else y
            x, y = (x * c - y * s) >> 220, (x * s + y * c) >> 220
    for part, column in zip(("real", "imag"), columns, strict=True):
        factors = [fixed(getattr(c, part)) for c in total.polynomial]
        for n in range(count):
            column[n] += sum(f * (2 * n - (count - 1)) ** m // count**m for m, f in enumerate(factors))
        if parts == 3:  # what quadruple precision holds
            excess = [max(abs(v).bit_length() - 113, 1) for v in column]
            column[:] = [(v + (1 << k - 1)) >> k << k for v, k in zip(column, excess, strict=True)]
    found = []
    for _ in range(parts):
        doubles = [np.array([v / one for v in column]) for column in columns]
        for column, values in zip(columns, doubles, strict=True):
            for n, v in enumerate(values.tolist()):
                top, bottom = v.as_integer_ratio()
                column[n] -= (top << 220) // bottom
        found.append((doubles[0], doubles[1]))
    return SignalSamples(tuple(found), real, 53 if parts == 1 else 113, CONTEXT)


def matched(found: Decomposition, true: Sum) -> list[tuple[float, float, float, float]]:
    """Of each true line the errors of frequency (relative) and amplitude, and what they are said to be."""
    rows = []
    for frequency, amplitude in zip(true.frequencies, true.amplitudes, strict=True):
        n = min(range(len(found.sum.frequencies)), key=lambda k: abs(found.sum.frequencies[k] - frequency))
        rows.append(
            (
                float(abs(found.sum.frequencies[n] / frequency - 1)),
                float(abs(found.sum.amplitudes[n] - amplitude)),
                found.frequency_errors[n] / abs(float(frequency)),
                found.amplitude_errors[n],
            )
        )
    return rows


def quasi_periodic(count: int) -> Sum:
    """Two incommensurate frequencies, the fast one of 1e4 periods in 3e4 samples; lines from 1 to 3e-12."""
    fast, slow = ROOT2 / 5, ROOT3 / 700
    return Sum(
        CONTEXT,
        count,
        (CONTEXT.mpc("0.25"), CONTEXT.mpc(3)),
        (fast, fast + slow, fast - slow, 3 * slow, fast - 4 * slow, CONTEXT.mpf("0.4321")),
        tuple(map(CONTEXT.mpc, ("1+0.3j", "1e-3", "1e-4j", "1e-6", "-1e-9j", "3e-12+1e-12j"))),
    )


@pytest.mark.parametrize("real", cases([False, True], [False]))
def test_leading_lines_are_right_to_the_last_digit_and_faint_ones_are_found(real: bool) -> None:
    # frequencies: eps over the angle turned, for the largest; amplitudes: rounding of samples, averaged
    true = quasi_periodic(36000)
    found = decompose(samples(true, real=real, parts=1), 10, 1, 1e-13)
    assert len(found.sum.frequencies) == 6
    assert not found.close
    assert not found.exhausted
    for n, (frequency, amplitude, said, said_amplitude) in enumerate(matched(found, true)):
        assert frequency < max(5 * said, 1e-15), n
        assert amplitude < max(6 * said_amplitude, 1e-15), n
    assert matched(found, true)[0][0] < 1e-16
    assert abs(found.sum.polynomial[1].real - 3) < 2e-15


def test_lines_two_bins_apart_do_not_move_each_other() -> None:
    # without the correction each would be off by about a tenth of a bin
    count = 2000
    first = CONTEXT.mpf(1) / 10
    true = Sum(
        CONTEXT, count, (), (first, first + CONTEXT.mpf(2) / count), (CONTEXT.mpc(1), CONTEXT.mpc("0.7j"))
    )
    found = decompose(samples(true, real=False, parts=1), 5, -1, 1e-12)
    assert len(found.sum.frequencies) == 2
    assert max(row[0] for row in matched(found, true)) < 1e-14
    assert max(row[1] for row in matched(found, true)) < 1e-14


def test_errors_are_those_of_noise() -> None:
    # the errors over what they are said to be have a standard deviation of 1 (40 draws: +-11 % each)
    rng = np.random.default_rng(7)
    count = 3000
    n = np.arange(count) - (count - 1) / 2
    clean = np.exp(2j * np.pi * 0.123456 * n) + 0.2 * np.exp(-2j * np.pi * 0.31 * n)
    pulls: list[tuple[float, float]] = []
    for _ in range(10):
        noise = 0.01 * (rng.standard_normal(count) + 1j * rng.standard_normal(count))
        values: Any = clean + noise
        found = decompose(SignalSamples(((values.real, values.imag),), False, 53, CONTEXT), 5, -1, 1e-12)
        assert len(found.sum.frequencies) == 2, "noise is no line"
        for true, frequency, error, amplitude, size, amplitude_error in zip(
            (0.123456, -0.31), found.sum.frequencies, found.frequency_errors, found.sum.amplitudes, (1, 0.2),
            found.amplitude_errors, strict=True,
        ):  # fmt: skip
            change = abs(complex(amplitude) - size) / amplitude_error
            pulls.append(((float(frequency) - true) / error, change))
    spread = np.sqrt(np.mean(np.square(pulls), axis=0))
    assert 0.6 < spread[0] < 1.5
    assert 0.6 < spread[1] < 1.5


# ---- lines are called what they are: in band, folded, ambiguous, and not at all where nothing fits

YEAR, MONTH, NODE = 2 * math.pi / 365.25, 2 * math.pi / 27.3217, -2 * math.pi / 6798.38
KNOWN = [Known("year", YEAR), Known("month", MONTH), Known("node", NODE)]


def folded(frequency: float, nyquist: float) -> float:
    return frequency - 2 * nyquist * round(frequency / (2 * nyquist))


@pytest.mark.parametrize("real", [False, True])
def test_a_line_is_its_simplest_combination_unfolded_through_the_known_frequencies(real: bool) -> None:
    found = label(2 * MONTH + NODE, 1e-12, KNOWN, math.pi, real=real)
    assert found == Label((0, 2, 1), "2 month + node", 0, ())
    nyquist = math.pi / 20
    seen = folded(2 * MONTH, nyquist)
    found = label(abs(seen) if real else seen, 1e-12, KNOWN, nyquist, real=real)
    sign = -1 if real and seen < 0 else 1
    assert found.multipliers == (0, 2 * sign, 0)
    assert found.folds * 2 * nyquist + (abs(seen) if real else seen) == pytest.approx(
        2 * MONTH * sign, rel=1e-12
    )


def test_lines_near_some_that_merge_are_found() -> None:
    """Four lines within 1.3 bins, as of the Earth's obliquity in a million years, hide no others."""
    rng, count, found = np.random.default_rng(1), 400, 0
    x = np.arange(count) - (count - 1) / 2
    for _ in range(4):
        base = rng.uniform(20, 30)
        apart = base + np.array([rng.uniform(8, 12), -rng.uniform(5.5, 9), rng.uniform(20, 30)])
        bins = np.concatenate([base + np.array([0, 0.42, 0.85, -0.42]), apart])
        sizes = np.concatenate([[1], rng.uniform(0.2, 0.6, 3), [0.25, 0.15, 0.01]])
        phases = rng.uniform(0, 6, 7)
        values = sizes @ np.cos(2 * np.pi / count * np.outer(bins, x) + phases[:, None])
        made = decompose(SignalSamples(((values, 0 * values),), True, 53, CONTEXT, None), 10, -1, 1e-3)
        got = np.array([float(f) * count for f in made.sum.frequencies])
        found += sum(np.abs(got - line).min() < 0.5 for line in apart)
    assert found >= 11, f"{found} of 12 lines"
