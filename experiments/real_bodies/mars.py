"""Mars' pole on the mean orbit of J2000: angles, circles of nutation, and the published series.

Angles and their published numbers are those of Konopliv, Park & Folkner 2016, Icarus 274, 253. The series of
nutations there is older: Reasenberg & King 1979, J. Geophys. Res. 84, 6231, as quoted.
"""

import math
from dataclasses import dataclass

import numpy as np

MAS = math.radians(1 / 3.6e6)
NODE, INCLINATION = math.radians(3.37919183), math.radians(24.67682669)
"""Of the mean orbit of J2000 on the Earth's mean equator of J2000."""
PSI, OBLIQUITY = 81.9683988, 25.1893823
"""At J2000: longitude of the equator's node on that orbit, and obliquity, deg."""
RATE = 350.891985307  # deg/day
PRECESSION, GEODETIC = -7608.3, 6.7
"""mas/yr: published, and its relativistic part, which no torque gives."""
HARMONICS = 6
LONGITUDE, TILT = {1: -632.6, 2: -44.2, 3: -4.0}, {1: -0.4}
SEASONAL = {
    1: (-49.1, -104.5),
    2: (515.7, 1097.0),
    3: (112.8, 240.1),
    4: (19.2, 40.9),
    5: (3.0, 6.5),
    6: (0.4, 1.0),
}
"""mas: longitude sin kM and obliquity cos kM; obliquity cos(kM + q) and longitude sin(kM + q)."""
PHASE = math.radians(142.0)


def anomaly(days: np.ndarray) -> np.ndarray:
    """Mean anomaly M of Mars, rad, so many days after J2000."""
    return np.asarray(np.radians(19.3870 + 0.52402068 * days))


def angles(figure_axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Longitude of the node (continuous) and obliquity on the mean orbit, rad, of vectors of the ICRF."""
    (cn, ci), (sn, si) = np.cos([NODE, INCLINATION]), np.sin([NODE, INCLINATION])
    axes = np.array([[cn, sn, 0], [-sn * ci, cn * ci, si], [sn * si, -cn * si, ci]])
    x, y, z = axes @ figure_axis.T
    return np.unwrap(np.arctan2(x, -y)), np.arctan2(np.hypot(x, y), z)


@dataclass(frozen=True)
class Nutation:
    """What a fit found.

    Attributes:
        start: longitude of the node and obliquity at J2000, deg.
        rates: of both there, mas/yr.
        circles: complex amplitude, mas, by multiple of the anomaly: negative ones retrograde.
        free: complex amplitudes of the free motions, mas.
        rest: what is left over, complex, mas.
    """

    start: tuple[float, float]
    rates: tuple[float, float]
    circles: dict[int, complex]
    free: list[complex]
    rest: np.ndarray

    def amplitudes(self, harmonic: int) -> tuple[float, float]:
        """In longitude and obliquity, mas, whatever the phase."""
        up, down = self.circles[harmonic], self.circles[-harmonic]
        size = math.sin(math.radians(self.start[1]))
        return abs(up + down.conjugate()) / size, abs(up - down.conjugate())


def fit(days: np.ndarray, figure_axis: np.ndarray, free: tuple[float, ...]) -> Nutation:
    """Both circles of each harmonic of the anomaly, a parabola, and free motions, by least squares.

    Args:
        days: after J2000; spaced by no simple part of a Martian day.
        figure_axis: unit vectors of the ICRF, (n, 3).
        free: frequencies in space of free motions, rad/day, retrograde ones negative.
    """
    psi, tilt = angles(figure_axis)
    mean = float(np.mean(psi)), float(np.mean(tilt))
    size = math.sin(mean[1])
    values = (size * (psi - mean[0]) - 1j * (tilt - mean[1])) / MAS
    harmonics = [k for k in range(-HARMONICS, HARMONICS + 1) if k]
    t, m = days / 36525, anomaly(days)
    columns = [t**k for k in range(3)] + [np.exp(1j * k * m) for k in harmonics]
    columns += [np.exp(1j * rate * days) for rate in free]
    matrix = np.stack(columns, axis=1)
    found, *_ = np.linalg.lstsq(matrix, values, rcond=None)
    here, slope = complex(found[0]), complex(found[1]) / 100
    last = 3 + len(harmonics)
    return Nutation(
        (math.degrees(mean[0] + here.real * MAS / size), math.degrees(mean[1] - here.imag * MAS)),
        (slope.real / size, -slope.imag),
        dict(zip(harmonics, found[3:last].tolist(), strict=True)),
        found[last:].tolist(),
        values - matrix @ found,
    )


def published(harmonic: int) -> tuple[float, float]:
    """Amplitudes in longitude and obliquity, mas, of all published terms of one harmonic."""
    tilt, longitude = SEASONAL[harmonic]
    turn = complex(math.cos(PHASE), math.sin(PHASE))
    return (abs(longitude * turn + LONGITUDE.get(harmonic, 0.0)), abs(tilt * turn + TILT.get(harmonic, 0.0)))


@dataclass(frozen=True)
class Core:
    """A mean equatorial moment A over C, and a core without friction: moment over C, flattening."""

    equatorial: float
    moment: float
    flattening: float

    @property
    def factor(self) -> float:
        """F = A_c/A_m."""
        own = self.moment * (1 - self.flattening)
        return own / (self.equatorial - own)

    def response(self, rate: float, spin: float) -> float:
        """Amplitude of the figure axis over that of a rigid body, by the linearised equations.

        Args:
            rate: of a circular nutation in space, retrograde ones negative, in the unit of the spin.
            spin: rate of rotation.
        """
        a, f, within = self.equatorial, self.flattening, rate - spin
        own = self.moment * (1 - f)
        mantle, polar = a - own, 1 - self.moment
        rigid = within - spin * (1 - a) / a
        pulled = self.moment * f * spin**2 / (mantle * (f * spin + (1 - f) * rate))
        return a / mantle * rigid / (within - spin * (polar - mantle) / mantle - pulled)

    def free_nutation(self, spin: float) -> float:
        """Frequency in space: the root of the response's denominator near -spin f A/A_m."""
        a, f, b, p = self.equatorial, self.flattening, spin, self.moment
        mantle = a - p * (1 - f)
        wobble = (1 - p - mantle) / mantle
        # (s - b wobble) (f b + (1 - f) (s + b)) = p f b^2/mantle, s = rate - spin
        roots = np.roots([1 - f, b - b * wobble * (1 - f), -(b**2) * (wobble + p * f / mantle)])
        return float(max(roots + b, key=lambda x: -abs(x)))

    def transfer(self, rate: float, spin: float) -> float:
        """1 + F s/(s - s0): the usual formula."""
        return 1 + self.factor * rate / (rate - self.free_nutation(spin))
