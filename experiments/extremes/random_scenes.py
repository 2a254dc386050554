"""Random scenes, log-uniform over all that the table visits point by point."""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction

from experiments.extremes.scenes import ANY, SEQUENCES, Extreme, lasting, principal

Uniform = Callable[[float, float], float]
"""A number between two others: of a generator, or drawn by hypothesis."""


def random_case(uniform: Uniform) -> tuple[Extreme, str, str, bool]:
    """A free body, and how to run it: formulation, precision, whether its invariants are held."""

    def one_of(choices: Sequence[str]) -> str:
        return choices[min(int(uniform(0, len(choices))), len(choices) - 1)]

    column = one_of(ANY)
    precision = one_of(("double", "double", "single", "extended"))
    rates = [_signed(uniform) * 10 ** uniform(-15, 0) for _ in range(3)]
    rates[min(int(uniform(0, 3)), 2)] = 1.0
    size = Fraction(10) ** round(uniform(-15, 15))
    written = tuple(str(Fraction(w) * size) for w in rates)
    # steps beyond double cost ten times as much
    longest = 9.0 if column == "closed_form" else 3.0 if precision == "extended" else 4.0
    sequence = one_of(SEQUENCES)
    middle = 10 ** uniform(-15, 0.2) + (0 if sequence[0] == sequence[2] else math.pi / 2)
    tolerance = None if uniform(0, 1) < 0.75 or column == "closed_form" else 10 ** uniform(-18, 0)
    scene = Extreme(
        "random", "", _body(uniform), written, lasting(10 ** uniform(-3, longest), float(size)),
        tolerance=tolerance, sequence=sequence,
        angles=(repr(uniform(-3, 3)), repr(middle), repr(uniform(-3, 3))),
    )  # fmt: skip
    return scene, column, precision, column in ("rates", "quaternion") and uniform(0, 1) < 0.2


def _signed(uniform: Uniform) -> float:
    return 1.0 if uniform(0, 1) < 0.5 else -1.0


def _body(uniform: Uniform) -> str:
    """Moments that a body can have, to the last digit: a, b and between abs(a - b) and a + b."""
    smaller = Fraction(10 ** uniform(-15, 0))
    share = Fraction(10 ** uniform(-15, 0))
    if uniform(0, 1) < 0.5:
        share = 1 - share
    moments = [Fraction(1), smaller, (1 - smaller) + share * 2 * smaller]
    turn = min(int(uniform(0, 3)), 2)
    size = round(uniform(-200, 200))
    return principal(*(_written(m, size) for m in moments[turn:] + moments[:turn]))


def _written(value: Fraction, power: int) -> str:
    """To 45 decimals, enough for 1e-15 of 1e-15 in the precisions that are tried."""
    return f"{value.numerator * 10**45 // value.denominator}e{power - 45}"
