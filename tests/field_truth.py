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


def moments_of(masses: np.ndarray, places: np.ndarray, radius: float, degree: int) -> Coefficients:
    """The field of point masses (rows of ``places``) about their centre, by direct sums of

    C + i S = (2 - delta_m0) (n - m)! / (n + m)! sum (mass / M) (r / R)^n P_nm(sin lat) exp(i m lon).
    """
    found = {}
    for n in range(3, degree + 1):
        for m in range(n + 1):
            total = mpmath.mpc(0)
            for mass, place in zip(masses, places, strict=True):
                r = np.linalg.norm(place)
                here = legendre(n, m, mpmath.mpf(place[2] / r))
                total += mass * (r / radius) ** n * here * mpmath.expj(m * math.atan2(place[1], place[0]))
            total *= (1 if m == 0 else 2) * mpmath.mpf(math.factorial(n - m)) / math.factorial(n + m)
            total /= masses.sum()
            found[n, m] = (float(mpmath.re(total)), float(mpmath.im(total)))
    return found


def lumpy(generator: np.random.Generator, count: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Masses and places of a body of point masses about its centre of mass."""
    masses, places = generator.uniform(0.5, 2, count), generator.uniform(-1, 1, (count, 3))
    return masses, places - masses @ places / masses.sum()


def tensor_of(masses: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Inertia tensor of point masses about the origin."""
    squares = np.einsum("i,ij,ij->", masses, places, places)
    products = np.einsum("i,ij,ik->jk", masses, places, places)
    return squares * np.eye(3) - (products + products.T) / 2


def pulled(masses: np.ndarray, places: np.ndarray, source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and torque by Newton's law on point masses by a source with G M = 1."""
    away = source - places
    forces = (masses / np.linalg.norm(away, axis=1) ** 3)[:, None] * away
    return forces.sum(axis=0), np.cross(places, forces).sum(axis=0)
