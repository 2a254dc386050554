"""First-order precession over deep time with heyoka alone: the Sun on a table of elements, the Moon averaged
over its node, linear tides, as `rigidsim run` has them (docs/for_cyclostratigraphers.md).

Run: python -m experiments.bare.deep_time TABLE OUT.h5      TABLE: rows as HNBody writes them, into the past
"""

import sys

import h5py
import heyoka as hy
import numpy as np
from scipy.interpolate import CubicSpline

YEAR, SPIN, ELLIPTICITY, TILT = 31557600.0, 7.292115e-5, 0.0032738134, np.radians(23.4392911)
SUN, AU, MOON, FAR = 1.32712440041e20, 1.495978707e11, 4.9028e12, 3.844e8
NODE = (1 - 1.5 * np.sin(np.radians(5.145)) ** 2) * (1 - 0.0549**2) ** -1.5
SLOWING, RECEDING = -2.705994e-10, -1.4516496e-10  # a year
EVERY = 10  # rows to a sample


def followed(path: str) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,), years, and spin axes (n, 3) at every tenth row."""
    days, axis, e, tilt, periapsis, node = np.loadtxt(path, skiprows=3, usecols=range(6)).T
    years, half = -days / 365.25, np.sin(np.radians(tilt) / 2)  # into the past
    k, h = e * np.cos(np.radians(periapsis)), e * np.sin(np.radians(periapsis))
    q, p = half * np.cos(np.radians(node)), half * np.sin(np.radians(node))
    rows = CubicSpline(years, np.array([k, h, q, p]).T).c.transpose(1, 2, 0).reshape(len(years) - 1, -1)
    s, t = np.array(hy.make_vars("x", "y", "z")), -hy.time
    since = hy.time - hy.par[16]
    k, h, q, p = (
        ((hy.par[i] * since + hy.par[i + 1]) * since + hy.par[i + 2]) * since + hy.par[i + 3]
        for i in range(0, 16, 4)
    )
    chi = hy.sqrt(1 - q * q - p * p)
    n = np.array([2 * p * chi, -2 * q * chi, 1 - 2 * (q * q + p * p)])
    size = 1.5 * ELLIPTICITY / SPIN * YEAR
    sun = size * SUN / (AU * axis[0]) ** 3 * (1 - k * k - h * h) ** -1.5
    rate = (1 + SLOWING * t) * (sun + size * MOON / FAR**3 * NODE * (1 + 2 * RECEDING * t))
    turned = rate * (n @ s) * np.cross(n, s)  # time runs back
    start = [0.0, -np.sin(TILT), np.cos(TILT)]
    engine = hy.taylor_adaptive(list(zip(s, turned, strict=True)), start, pars=[*rows[0], years[0]])
    row, axes = 0, [engine.state.copy()]

    def next_row(engine: hy.taylor_adaptive_dbl) -> bool:
        nonlocal row
        row += 1
        if row % EVERY == 0:
            axes.append(engine.state.copy())
        if row < len(rows):
            engine.pars[:16], engine.pars[16] = rows[row], years[row]
        return True

    engine.propagate_until(years[-1], max_delta_t=years[1] - years[0], callback=next_row)
    return -years[: len(years) : EVERY], np.array(axes)


if __name__ == "__main__":
    times, found = followed(sys.argv[1])
    with h5py.File(sys.argv[2], "w") as file:
        file["time"], file["axis"] = times, found
