"""Numbers as decimals from which the same bits can be restored, and angles in other units."""

import math
from collections.abc import Sequence
from decimal import ROUND_HALF_EVEN, Context, Decimal
from functools import lru_cache, reduce

import mpmath
import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.scene.readable import ANGLE_UNITS, AngleUnit

FEW = 9
"""Different numbers of one matrix, whose digits say nothing of a format."""
_FIXED = 0.6  # share of numbers with the same count of decimals that a fixed format makes
_DOUBLE_DIGITS = 15
_SINGLE = 2.0**-24  # relative rounding of single precision
_SINGLE_DIGITS = 7  # up to which numbers of few digits are taken for such, rather than for single precision

# Sums of doubles end at 2^-1074 and stay below 2^1025: 1,400 digits hold each exactly.
_EXACT = Context(prec=1400, Emax=10**6, Emin=-(10**6))


def texts(parts: Sequence[np.ndarray], bits: int) -> list[str]:
    """Numbers, sums of (rows,) each, with as many digits as their bits need; ``nan``, ``inf`` and ``-0.0``
    unchanged. For a single part it is the shortest text that gives the same double.
    """
    if len(parts) == 1:
        return [repr(value) for value in parts[0].tolist()]
    enough = math.ceil(bits * math.log10(2)) + 1  # 10^(N-1) > 2^bits (Goldberg 1991, theorem 15)
    contexts = [
        Context(prec=max(digits, 17), rounding=ROUND_HALF_EVEN, Emax=10**6, Emin=-(10**6))
        for digits in range(enough - 2, enough + 1)
    ]
    found = []
    for row in zip(*(part.tolist() for part in parts), strict=True):
        if math.isfinite(row[0]) and row[0] != 0.0:
            exact = reduce(_EXACT.add, map(Decimal, reversed(row)))
            value = _short(exact, row[0], bits, contexts)
            found.append(f"{value:f}" if -7 <= value.adjusted() < 17 else f"{value:e}")
        else:
            found.append(repr(row[0]))
    return found


def _short(value: Decimal, lead: float, bits: int, contexts: Sequence[Context]) -> Decimal:
    """The value with the fewest of these digits that still identify it: 0.3 rather than 0.2999...9996."""
    quarter = _power_of_two(math.frexp(lead)[1] - bits - 2)  # of the spacing, also just below a power of two
    for context in contexts[:-1]:
        short = context.plus(value)
        if abs(_EXACT.subtract(short, value)) < quarter:
            return short.normalize(context)
    return contexts[-1].plus(value).normalize(contexts[-1])


@lru_cache(maxsize=4096)
def _power_of_two(exponent: int) -> Decimal:
    return _EXACT.power(Decimal(2), exponent)


def decimals(parts: Sequence[np.ndarray], bits: int) -> list[Decimal]:
    """The numbers of ``texts`` as decimals; callers have refused values that aren't finite."""
    return [Decimal(text) for text in texts(parts, bits)]


RADIAN = "rad"
_GUARD_BITS = 64
_PI = np.longdouble("3.141592653589793238462643383279502884")


def angle_unit_named(name: str) -> AngleUnit:
    """The unit of angle with the given name."""
    if name not in ANGLE_UNITS:
        raise RigidsimError(f'--angle-unit: given "{name[:40]}"; allowed: {", ".join(ANGLE_UNITS)}')
    return ANGLE_UNITS[name]


def converted(parts: Sequence[np.ndarray], unit: AngleUnit, bits: int) -> list[np.ndarray]:
    """Angles in rad, sums of arrays of one shape, converted to a unit, rounded once to so many bits; a single
    part is worked out in 64 bits.
    """
    if unit.per_turn is None:
        return list(parts)
    if len(parts) == 1:
        factor = np.longdouble(unit.per_turn) / (2 * _PI)
        return [(parts[0].astype(np.longdouble) * factor).astype(np.float64)]
    context = mpmath.MPContext()
    context.prec = bits + _GUARD_BITS
    scale = unit.per_turn / (2 * context.pi)
    found = [np.empty(parts[0].shape) for _ in parts]
    for index in np.ndindex(parts[0].shape):
        lead = float(parts[0][index])
        if not np.isfinite(lead) or lead == 0.0:
            for part, given in zip(found, parts, strict=True):
                part[index] = given[index]
            continue
        value = context.fsum(float(part[index]) for part in parts) * scale
        exponent = context.frexp(value)[1]
        value = context.ldexp(context.nint(context.ldexp(value, bits - exponent)), exponent - bits)
        for part in found:
            part[index] = float(value)
            value -= part[index]
    return found


def written_resolution(values: np.ndarray, narrow: bool, few: int = 0) -> float:
    """Half the last digit in which numbers are written, from a sample of them; that of doubles at least, or
    that of single precision where all are such numbers. Up to ``few`` different numbers, as of a body at
    rest, are taken for exact.
    """
    most = float(np.abs(values).max())
    if narrow:
        return most * _SINGLE
    places = np.linspace(0, values.size - 1, min(values.size, 300)).astype(int)
    some = values.reshape(-1)[places]
    if len(np.unique(some)) <= few:
        return most * 2.0**-53
    written = [Decimal(repr(value)).normalize().as_tuple() for value in some.tolist()]
    decimals = [-int(exponent) for _, _, exponent in written]
    common = max(set(decimals), key=decimals.count)
    digits = max(len(mantissa) for _, mantissa, _ in written)
    if decimals.count(common) > _FIXED * len(decimals) and max(decimals) == common:
        found = 0.5 * 10.0**-common if common < _DOUBLE_DIGITS else most * 2.0**-53
    else:
        found = most * (0.5 * 10.0 ** (1 - digits) if digits < _DOUBLE_DIGITS else 2.0**-53)
    with np.errstate(over="ignore"):
        single = np.abs(some - some.astype(np.float32)) <= 0.5 * 10.0 ** -np.array(decimals, float)
    if single.all() and digits > _SINGLE_DIGITS:
        return max(found, most * _SINGLE)
    return found
