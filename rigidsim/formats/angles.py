"""Conversion of a dataset's angles (rad) to the unit of an export, with all digits of the run."""

from __future__ import annotations

from collections.abc import Sequence

import mpmath
import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.scene.readable_units import ANGLE_UNITS, AngleUnit

RADIAN = "rad"
_GUARD_BITS = 64
_PI = np.longdouble("3.141592653589793238462643383279502884")


def angle_unit_named(name: str) -> AngleUnit:
    """The unit of angle with the given name."""
    if name not in ANGLE_UNITS:
        raise RigidsimError(f'--angle-unit: given "{name[:40]}"; allowed: {", ".join(ANGLE_UNITS)}')
    return ANGLE_UNITS[name]


def converted(parts: Sequence[np.ndarray], unit: AngleUnit, bits: int) -> list[np.ndarray]:
    """Angles in rad converted to a unit, rounded once to the run's precision.

    Args:
        parts: float64 arrays of one shape, whose sum is the value.
        bits: bits of the run's precision; up to 53, one part is worked out in 64 bits.
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
