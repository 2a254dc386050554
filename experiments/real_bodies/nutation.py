"""Circular nutations of a figure axis: every known line fitted at once, with a cubic.

The pole on the mean equator and equinox of date is X + iY = sin(eps) dpsi + i deps; each argument
(multiples of the Delaunay arguments) has a prograde and a retrograde circle, c exp(+-i theta). Arguments
are those of IAU 2000B (McCarthy & Luzum 2003, Celest. Mech. Dyn. Astr. 85, 37), those above 0.1 mas; its
line of 10,500 years is part of the cubic.
"""

import math
from dataclasses import dataclass

import numpy as np

from experiments.bare import precession
from experiments.bare.precession import ARCSEC, centuries

LINES = """
00001 002-22 00202 00002 01000 012-22 10000 00201 10202 0-12-22 002-21 -10202 -10020 10001 -10001 -10222 10201
-20201 00020 00222 -20020 20202 102-22 -10201 20000 00200 01001 -10021 022-22 00-220 100-21 0-1001 -10221
02000 10222 -20200 01202 00221 0-1202 00021 102-21 202-22 -20021 20201 0-12-21 000-21 -1-1020 200-21 10020
012-21 1-1000 -20202 30202 0-1020 1-1202 00010 -1-1222 -10200 0-1222 -11010 11000 10200 -10010
"""
"""Multiples of l, l', F, D, Omega, digit by digit."""
PUBLISHED = {
    "18.6 yr retrograde": ((0, 0, 0, 0, 1), -1, 8050.867),
    "18.6 yr prograde": ((0, 0, 0, 0, 1), 1, 1177.043),
    "182.6 d prograde": ((0, 0, 2, -2, 2), 1, 530.743),
    "13.66 d prograde": ((0, 0, 2, 0, 2), 1, 91.517),
    "annual retrograde": ((0, 1, 0, 0, 0), -1, 24.894),
}
"""Argument, sense, amplitude in mas of a rigid Earth's figure axis."""
TURNS = 2 * math.pi * 1.00273781191135448 * 36525
"""Turns of the Earth in a century, rad."""


def multiples() -> list[tuple[int, ...]]:
    """Of the Delaunay arguments, one row a line."""
    found = []
    for word in LINES.split():
        row, sign = [], 1
        for letter in word:
            if letter == "-":
                sign = -1
            else:
                row.append(sign * int(letter))
                sign = 1
        found.append(tuple(row))
    return found


def delaunay(julian_dates: np.ndarray) -> np.ndarray:
    """l, l', F, D, Omega, rad, (5, n): Simon et al. 1994, Astron. Astrophys. 282, 663."""
    t = centuries(julian_dates)
    degrees = [134.96340251, 357.52910918, 93.27209062, 297.85019547, 125.04455501]
    series = [
        [1717915923.2178, 31.8792, 0.051635],
        [129596581.0481, -0.5532, 0.000136],
        [1739527262.8478, -12.7512, -0.001037],
        [1602961601.2090, -6.3706, 0.006593],
        [-6962890.5431, 7.4722, 0.007702],
    ]
    return np.array(
        [
            math.radians(first) + (a * t + b * t**2 + c * t**3) * ARCSEC
            for first, (a, b, c) in zip(degrees, series, strict=True)
        ]
    )


@dataclass(frozen=True)
class Nutations:
    """What a fit found.

    Attributes:
        circles: complex amplitude (mas) by multiples and sense: +1 prograde, -1 retrograde.
        secular: of 1, t, t^2, t^3 (centuries, mas), complex.
        free: the free nutation's complex amplitude, mas.
        rest: what is left over, complex, mas, a value a sample.
    """

    circles: dict[tuple[tuple[int, ...], int], complex]
    secular: np.ndarray
    free: complex
    rest: np.ndarray

    def amplitude(self, name: str) -> float:
        """Of a line of PUBLISHED, mas."""
        argument, sense, _ = PUBLISHED[name]
        return abs(self.circles[argument, sense])


def fit(julian_dates: np.ndarray, figure_axis: np.ndarray, free_rate: float) -> Nutations:
    """Every line's two circles, a cubic, and the free nutation, by least squares.

    Args:
        julian_dates: TDB; spaced by no simple part of a day, or daily lines pass for slow ones.
        figure_axis: unit vectors in axes of J2000 (ICRF), (n, 3).
        free_rate: of the free nutation in space over the rate of rotation, about 1 + (C - A)/A.
    """
    poles = precession.to_date(julian_dates, figure_axis)
    values = (poles[:, 0] + 1j * poles[:, 1]) / ARCSEC * 1000
    t, arguments = centuries(julian_dates), delaunay(julian_dates)
    keys, columns = [], []
    for row in multiples():
        theta = np.tensordot(np.array(row), arguments, axes=1)
        rate = np.sign(theta[-1] - theta[0])
        for sense in (1, -1):
            keys.append((row, sense))
            columns.append(np.exp(1j * sense * rate * theta))
    columns += [t**k for k in range(4)] + [np.exp(1j * free_rate * TURNS * t)]
    matrix = np.stack(columns, axis=1)
    found, *_ = np.linalg.lstsq(matrix, values, rcond=1e-12)
    lines = len(keys)
    return Nutations(
        dict(zip(keys, found[:lines].tolist(), strict=True)),
        found[lines : lines + 4],
        complex(found[-1]),
        values - matrix @ found,
    )
