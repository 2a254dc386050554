"""Where the averaged equations have Cassini states: what the search for the full ones begins at.

In the frame that turns with the node at the rate g about the pole k of its plane, the spin axis s of a body
with the momentum L about its largest axis moves by H = U(s) - g L k . s, where U is the gradient's potential
averaged over the orbit and, out of resonance, over the rotation (Colombo 1966, Astronomical Journal 71, 891;
Peale 1969, Astronomical Journal 74, 483). In step with the orbit, p turns to a revolution, U has the part

    -(3 G M / 4 a^3) (B - A) |<(a/r)^3 (r1 + i r2)^2 exp -2 i (p M + w)>|

besides, with r1, r2 the source's direction along the node and across it in the body's equator: the least axis
is turned to where that is lowest. States lie in the plane of k and the orbit's normal n, where H is
stationary; with the angle th from n towards k and I between both, a body of A = B has

    (C - A)/C (3 G M / 2 a^3) (1 - e^2)^(-3/2) / w cos th sin th + g sin(th - I) = 0.

They are numbered as by Peale for a node that moves backwards: 1 and 3 are the least values of H nearest to
n and to -n, 2 the greatest on k's side, 4 that on the other. A node that moves forwards gives the same with
the spin reversed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidsim.scene.orbits import KeplerOrbit

_ANOMALIES = 1024
_ANGLES = 1440
_BISECTIONS = 60
_STEP = 1e-4  # rad, of derivatives


@dataclass(frozen=True)
class AveragedState:
    """A state of the averaged equations.

    Attributes:
        number: 1 to 4.
        tilt: th, rad, from -pi to pi.
        phase: angle of the least axis from the node beyond p M + w, rad.
    """

    number: int
    tilt: float
    phase: float


@dataclass(frozen=True)
class Colombo:
    """H of a body and an orbit.

    Attributes:
        moments: least, middle, largest, kg m^2.
        spin: of the body about its largest axis in the turning frame, rad/s.
        turns: p, or None out of resonance.
    """

    orbit: KeplerOrbit
    strength: float  # G M / a^3, 1/s^2
    moments: tuple[float, float, float]
    spin: float
    turns: float | None
    periapsis: float

    def states(self) -> list[AveragedState]:
        """All states there are."""
        grid = -np.pi + 2 * np.pi * (np.arange(_ANGLES + 1) + 0.5) / _ANGLES
        slopes = self._slope(grid)
        found = []
        for i in np.flatnonzero(np.sign(slopes[:-1]) != np.sign(slopes[1:])):
            low, high = float(grid[i]), float(grid[i + 1])
            least = slopes[i] < 0
            for _ in range(_BISECTIONS):
                middle = (low + high) / 2
                inside = (self._slope(np.array([middle]))[0] < 0) == least
                low, high = (middle, high) if inside else (low, middle)
            found.append((least, (low + high) / 2))
        return self._numbered(found)

    def _numbered(self, found: list[tuple[bool, float]]) -> list[AveragedState]:
        numbers: dict[int, float] = {}
        for least, tilt in found:
            seen = tilt if self._backwards else tilt + np.pi
            seen = (seen + np.pi) % (2 * np.pi) - np.pi
            number = (1 if abs(seen) < np.pi / 2 else 3) if least else (2 if seen > 0 else 4)
            numbers.setdefault(number, (tilt + np.pi) % (2 * np.pi) - np.pi)
        return [AveragedState(n, tilt, self._phase(tilt)) for n, tilt in sorted(numbers.items())]

    @property
    def _backwards(self) -> bool:
        return bool(self.orbit.node_rate < 0)

    def _slope(self, tilts: np.ndarray) -> np.ndarray:
        ahead, behind = (self._energy(tilts + sign * _STEP)[0] for sign in (1, -1))
        turning = float(self.orbit.node_rate) * self.moments[2] * self.spin
        return np.asarray(
            (ahead - behind) / (2 * _STEP) + turning * np.sin(tilts - float(self.orbit.inclination))
        )

    def _phase(self, tilt: float) -> float:
        return float(self._energy(np.array([tilt]))[1][0])

    def _energy(self, tilts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """U (J) and the least axis' phase at angles (n,)."""
        least, middle, most = self.moments
        e, tilt = float(self.orbit.eccentricity), float(self.orbit.inclination)
        eccentric = 2 * np.pi * np.arange(_ANOMALIES) / _ANOMALIES
        mean = eccentric - e * np.sin(eccentric)
        radius = 1 - e * np.cos(eccentric)
        weight = radius / radius**3 / _ANOMALIES  # dM = (1 - e cos E) dE
        true = np.arctan2(np.sqrt(1 - e * e) * np.sin(eccentric), np.cos(eccentric) - e) + self.periapsis
        source = np.array([np.cos(true), np.sin(true) * np.cos(tilt), np.sin(true) * np.sin(tilt)])
        lean = tilt - tilts  # of the spin axis from k
        second = np.array([np.zeros_like(lean), np.cos(lean), np.sin(lean)])
        pole = np.array([np.zeros_like(lean), -np.sin(lean), np.cos(lean)])
        r1, r2, r3 = source[0][None, :], second.T @ source, pole.T @ source
        flat = (most - (least + middle) / 2) * (weight * r3**2).sum(axis=1)
        phase = np.zeros_like(tilts)
        if self.turns is not None:
            wave = np.exp(-2j * (self.turns * mean + self.periapsis))
            part = (weight * (r1 + 1j * r2) ** 2 * wave).sum(axis=1)
            flat = flat - (middle - least) / 2 * np.abs(part)
            phase = np.angle(part) / 2
        return 1.5 * self.strength * flat, phase


def doubles(values: Any) -> tuple[float, ...]:
    """Numbers as doubles."""
    return tuple(float(x) for x in values)
