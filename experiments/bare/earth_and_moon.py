"""What point masses leave out of the Moon's motion about the Earth, against DE421, by DOP853.

python -m experiments.bare.earth_and_moon [--days 10]

Sun, Earth, Moon and Jupiter start where DE421 has them and go on as point masses; then effects are added:
the Earth's J2 (pole of 1969), the Moon's figure (long axis along the line to the Earth), the relativistic
equations of point masses (Einstein, Infeld & Hoffmann, to 1/c^2), and the other planets. Printed is how far
the Moon is from its place in DE421, seen from the Earth. m and s.
"""

import argparse
from collections.abc import Collection, Sequence

import de421
import numpy as np
from jplephem.ephem import Ephemeris
from scipy.integrate import DOP853

EPOCH = 2440423.0  # 1969-07-20T12:00 TDB
EFFECTS = ("j2", "figure", "relativity", "planets")
DAY, LIGHT = 86400.0, 299792458.0
_KERNEL = Ephemeris(de421)
_CUBE = (1000 * _KERNEL.AU) ** 3 / DAY**2
_EARTH = _KERNEL.GMB * _KERNEL.EMRAT / (1 + _KERNEL.EMRAT) * _CUBE
STRENGTHS = {
    "sun": _KERNEL.GMS * _CUBE,
    "earth": _EARTH,
    "moon": _EARTH / _KERNEL.EMRAT,
    "jupiter": _KERNEL.GM5 * _CUBE,
}
_PLANETS = {
    name: getattr(_KERNEL, f"GM{n}") * _CUBE
    for name, n in (("mercury", 1), ("venus", 2), ("mars", 4), ("saturn", 6), ("uranus", 7), ("neptune", 8))
}
_EARTH_PLACE, _MOON_PLACE = 1, 2


def barycentric(name: str, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Place and velocity."""
    pair = {"earth": -1 / (1 + _KERNEL.EMRAT), "moon": _KERNEL.EMRAT / (1 + _KERNEL.EMRAT)}
    file = "earthmoon" if name in pair else name
    place, speed = (np.asarray(x)[:, 0] for x in _KERNEL.position_and_velocity(file, EPOCH, seconds / DAY))
    if name in pair:
        found = _KERNEL.position_and_velocity("moon", EPOCH, seconds / DAY)
        place, speed = (
            x + pair[name] * np.asarray(y)[:, 0] for x, y in zip((place, speed), found, strict=True)
        )
    return 1000 * place, 1000 * speed / DAY


def accelerations(x: np.ndarray, v: np.ndarray, gm: np.ndarray, effects: Collection[str]) -> np.ndarray:
    """Of all masses, (n, 3)."""
    count = len(gm)
    apart = x[None] - x[:, None]
    far = np.linalg.norm(apart, axis=2) + np.eye(count)
    weights = gm[None, :] * (1 - np.eye(count))
    found = np.einsum("ij,ijk->ik", weights / far**3, apart)
    e, m = _EARTH_PLACE, _MOON_PLACE
    if "j2" in effects:
        centuries = (EPOCH - 2451545.0) / 36525
        theta, z = (np.deg2rad(x * centuries / 3600) for x in (2004.3109, 2306.2181))
        pole = np.array([-np.sin(theta) * np.cos(z), -np.sin(theta) * np.sin(z), np.cos(theta)])
        y = x[m] - x[e]
        r = np.linalg.norm(y)
        s = y @ pole / r
        size = 1.5 * _KERNEL.J2E * (1000 * _KERNEL.RE / r) ** 2 / r**2
        pull = size * ((5 * s * s - 1) * y / r - 2 * s * pole)
        found[m] += gm[e] * pull
        found[e] -= gm[m] * pull
    if "figure" in effects:
        y = x[e] - x[m]
        r = np.linalg.norm(y)
        pull = -3 * (1000 * _KERNEL.AM / r) ** 2 / r**3 * (_KERNEL.J2M / 2 + 3 * _KERNEL.C22M) * y
        found[e] += gm[m] * pull
        found[m] -= gm[e] * pull
    return found + _relativistic(x, v, gm, found, far, weights) if "relativity" in effects else found


def _relativistic(
    x: np.ndarray, v: np.ndarray, gm: np.ndarray, newton: np.ndarray, far: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Terms in 1/c^2 (Standish & Williams, Explanatory Supplement, eq. 8.1)."""
    depth, squares = (weights / far).sum(axis=1), (v * v).sum(axis=1)
    found = np.zeros_like(x)
    for i in range(len(gm)):
        for j in range(len(gm)):
            if i == j:
                continue
            to, r = x[j] - x[i], far[i, j]
            factor = squares[i] + 2 * squares[j] - 4 * v[i] @ v[j] - 4 * depth[i] - depth[j]
            factor += -1.5 * (to @ v[j] / r) ** 2 + to @ newton[j] / 2
            found[i] += gm[j] / r**3 * (factor * to + (-to @ (4 * v[i] - 3 * v[j])) * (v[i] - v[j]))
            found[i] += 3.5 * gm[j] / r * newton[j]
    return found / LIGHT**2


def moon_from_earth(days: float, effects: Collection[str] = ()) -> np.ndarray:
    """After some days."""
    strengths = STRENGTHS | (_PLANETS if "planets" in effects else {})
    gm, n = np.array(list(strengths.values())), len(strengths)
    start = [barycentric(name, 0.0) for name in strengths]

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        x, v = y.reshape(2, n, 3)
        return np.concatenate([v.ravel(), accelerations(x, v, gm, effects).ravel()])

    y = np.concatenate([np.ravel([pair[k] for pair in start]) for k in (0, 1)])
    least = np.repeat([1e-4, 1e-10], 3 * n)
    solver = DOP853(slope, 0.0, y, days * DAY, rtol=1e-13, atol=least, max_step=2e4)
    while solver.status == "running":
        solver.step()
    places = solver.y.reshape(2, n, 3)[0]
    return np.asarray(places[_MOON_PLACE] - places[_EARTH_PLACE])


def departure(days: float, effects: Collection[str] = ()) -> float:
    """From DE421, m."""
    wanted = barycentric("moon", days * DAY)[0] - barycentric("earth", days * DAY)[0]
    return float(np.linalg.norm(moon_from_earth(days, effects) - wanted))


def main(argv: Sequence[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m experiments.bare.earth_and_moon")
    parser.add_argument("--days", type=float, default=10.0)
    days = parser.parse_args(argv).days
    for count in range(len(EFFECTS) + 1):
        effects = EFFECTS[:count]
        print(
            f"{departure(days, effects):9.2f} m with {', '.join(effects) or 'point masses alone'}", flush=True
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
