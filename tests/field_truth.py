"""Gravity fields in other words: Legendre functions as explicit sums, and bodies of point masses."""

import math
from typing import Any

import mpmath
import numpy as np

Coefficients = dict[tuple[int, int], tuple[float, float]]
"""C and S, unnormalized, by degree and order."""


def legendre(n: int, m: int, t: Any) -> Any:
    """P_nm without the phase of Condon and Shortley, from the derivatives of (t^2 - 1)^n (Rodrigues)."""
    total = mpmath.mpf(0)
    for k in range((n - m) // 2 + 1):
        sign = (-1) ** k * math.factorial(2 * n - 2 * k)
        below = math.factorial(k) * math.factorial(n - k) * math.factorial(n - 2 * k - m)
        total += mpmath.mpf(sign) / below * t ** (n - 2 * k - m)
    return (1 - t * t) ** (mpmath.mpf(m) / 2) * total / 2**n


def potential(coefficients: Coefficients, radius: float, place: Any) -> Any:
    """Phi at a place (mpf, body axes): (1/r) sum (R/r)^n P_nm(sin lat) (C cos m lon + S sin m lon)."""
    x, y, z = place
    r = mpmath.sqrt(x * x + y * y + z * z)
    longitude, total = mpmath.atan2(y, x), mpmath.mpf(0)
    for (n, m), (c, s) in coefficients.items():
        both = c * mpmath.cos(m * longitude) + s * mpmath.sin(m * longitude)
        total += (radius / r) ** n * legendre(n, m, z / r) * both / r
    return total


def gradient(coefficients: Coefficients, radius: float, place: np.ndarray) -> np.ndarray:
    """Its gradient, by differences in 60 digits."""
    with mpmath.workdps(60):
        point = [mpmath.mpf(float(x)) for x in place]
        step = mpmath.mpf(10) ** -20
        found = []
        for i in range(3):
            either = [[x + sign * step * (i == k) for k, x in enumerate(point)] for sign in (1, -1)]
            high, low = (potential(coefficients, radius, there) for there in either)
            found.append(float((high - low) / (2 * step)))
    return np.array(found)


def keys(coefficients: Coefficients, radius: float) -> str:
    """``gravity_field`` of a config."""
    cosines = ", ".join(f'"{n},{m}" = {c!r}' for (n, m), (c, _) in coefficients.items())
    sines = ", ".join(f'"{n},{m}" = {s!r}' for (n, m), (_, s) in coefficients.items() if m)
    given = f", S = {{{sines}}}" if sines else ""
    return f"gravity_field = {{radius = {radius!r}, C = {{{cosines}}}{given}}}"


def random_field(generator: np.random.Generator, degree: int, size: float = 0.1) -> Coefficients:
    """Coefficients of degrees 3 to ``degree``, whose harmonics are all of the same size."""
    found = {}
    for n in range(3, degree + 1):
        for m in range(n + 1):
            scale = size * math.sqrt(math.factorial(n - m) / math.factorial(n + m))
            c, s = generator.uniform(-scale, scale, 2)
            found[n, m] = (float(c), float(s) if m else 0.0)
    return found
