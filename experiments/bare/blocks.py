"""Positions of a JPL package (`de421`, `de423`, ...) as polynomials in the time of one block of four days.

Read from the package's numpy files, with no other reader in between. Longer blocks are cut into pieces of
four days (exactly: the same polynomial in another variable), and differences of positions are those of
polynomials. Kilometres, days, axes of the ICRF.
"""

import importlib
import math
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np
from numpy.polynomial import chebyshev

DAYS = 4.0
"""One block, the Moon's own."""
TERMS = 15
"""Coefficients that a polynomial may have before what is below rounding is dropped."""
PLANETS = ("mercury", "venus", "mars", "jupiter", "saturn", "uranus", "neptune")
_MASSES = ("GM1", "GM2", "GM4", "GM5", "GM6", "GM7", "GM8")


class Kernel:
    """One package: its constants, its blocks, and gravitational parameters in km^3/day^2."""

    def __init__(self, package: str = "de421") -> None:
        self.folder = Path(str(importlib.import_module(package).__file__)).parent
        self.constants = {
            name.decode().strip(): float(value) for name, value in np.load(self.folder / "constants.npy")
        }
        c = self.constants
        self.first, self.last = c["jalpha"], c["jomega"]
        cube = c["AU"] ** 3
        self.parameters = {"sun": c["GMS"] * cube}
        self.parameters |= {body: c[key] * cube for body, key in zip(PLANETS, _MASSES, strict=True)}
        self.parameters["earth"] = c["GMB"] * cube * c["EMRAT"] / (1 + c["EMRAT"])
        self.parameters["moon"] = c["GMB"] * cube / (1 + c["EMRAT"])

    def series(self, name: str, julian_date: float, blocks: int) -> np.ndarray:
        """Chebyshev coefficients (blocks, 3, TERMS) of one file, on pieces of four days from a date."""
        stored = np.load(self.folder / f"jpl-{name}.npy", mmap_mode="r")
        length = (self.last - self.first) / len(stored)
        parts = round(length / DAYS)
        starts = round((julian_date - self.first) / DAYS) + np.arange(blocks)
        if starts[0] < 0 or starts[-1] >= parts * len(stored):
            raise ValueError(f"the kernel covers JD {self.first} to {self.last}")
        found = np.zeros((blocks, len(stored[0]), TERMS))
        # A piece of a long block is the same polynomial in another variable: its values at Chebyshev nodes.
        nodes = chebyshev.chebpts1(TERMS)
        back = np.linalg.inv(chebyshev.chebvander(nodes, TERMS - 1))
        for part in range(parts):
            chosen = starts % parts == part
            whole = (nodes + 1 + 2 * part) / parts - 1
            matrix = back @ chebyshev.chebvander(whole, stored.shape[2] - 1)
            if parts == 1:
                matrix = np.eye(TERMS, stored.shape[2])
            found[chosen] = stored[starts[chosen] // parts] @ matrix.T
        return found

    def places(self, host: str, sources: tuple[str, ...], julian_date: float, blocks: int) -> dict:
        """Chebyshev coefficients of each source's place from the host (the Earth or the Moon)."""
        ratio = self.constants["EMRAT"]
        moon = self.series("moon", julian_date, blocks)
        barycentre = self.series("earthmoon", julian_date, blocks)
        here = barycentre - moon / (1 + ratio) if host == "earth" else barycentre + moon * ratio / (1 + ratio)
        found = {}
        for source in sources:
            if source in ("earth", "moon"):
                found[source] = moon if host == "earth" else -moon
            else:
                found[source] = self.series(source, julian_date, blocks) - here
        return found


def terms(coefficients: np.ndarray) -> int:
    """How many Chebyshev terms are above rounding in some block."""
    size = np.abs(coefficients).max(axis=(0, 1))
    return int(np.flatnonzero(size > 2e-17 * size.max()).max()) + 1


def powers(coefficients: np.ndarray, count: int) -> np.ndarray:
    """Coefficients of the powers of s = 2 t/DAYS - 1 of the first Chebyshev terms, (blocks, axes, count)."""
    matrix = np.zeros((count, count))
    for k in range(count):
        matrix[: k + 1, k] = chebyshev.cheb2poly(np.eye(count)[k])[: k + 1]
    return coefficients[..., :count] @ matrix.T


def later(coefficients: np.ndarray, days: float) -> np.ndarray:
    """Powers' coefficients of the motion so many days later (earlier, if negative)."""
    count = coefficients.shape[-1]
    shift = 2 * days / DAYS
    matrix = np.zeros((count, count))
    for k in range(count):
        line = np.polynomial.polynomial.polypow([shift, 1.0], k)
        matrix[: k + 1, k] = line
    return coefficients @ matrix.T


class Columns:
    """Polynomials as rows of an integrator's parameters, one row a block.

    Args:
        series: powers' coefficients (blocks, 3, count) by name.
    """

    def __init__(self, series: dict[str, np.ndarray]) -> None:
        self.rows = np.concatenate([values.reshape(len(values), -1) for values in series.values()], axis=1)
        self._where, at = {}, 0
        for name, values in series.items():
            self._where[name] = (at, values.shape[-1])
            at += 3 * values.shape[-1]

    def place(self, name: str) -> list:
        """Of a body, in heyoka's time, which counts from the block's edge; empty if unknown."""
        if name not in self._where:
            return []
        first, count = self._where[name]
        s, found = 2.0 / DAYS * hy.time - 1.0, []
        for axis in range(3):  # Horner's rule
            value: Any = hy.par[first + axis * count + count - 1]
            for k in range(count - 2, -1, -1):
                value = hy.par[first + axis * count + k] + s * value
            found.append(value)
        return found

    def begin(self, name: str) -> list[float]:
        """At the first block's edge, s = -1."""
        if name not in self._where:
            return []
        first, count = self._where[name]
        series = self.rows[0, first : first + 3 * count].reshape(3, count)
        return [float(x) for x in series @ (-1.0) ** np.arange(count)]


def euler_quaternion(*turns: tuple[float, int]) -> np.ndarray:
    """Of turns by angles about axes (1, 2 or 3) of the body, one after the other."""
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for angle, axis in turns:
        turn = np.zeros(4)
        turn[0], turn[axis] = math.cos(angle / 2), math.sin(angle / 2)
        vector = q[0] * turn[1:] + turn[0] * q[1:] + np.cross(q[1:], turn[1:])
        q = np.array([q[0] * turn[0] - q[1:] @ turn[1:], *vector])
    return q
