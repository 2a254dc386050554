"""Places on Kepler's orbits, in the numbers of a context of mpmath."""

from typing import Any


def turned(mp: Any, v: list[Any], *turns: tuple[Any, int]) -> list[Any]:
    """A vector after turns by angles about the axes 1 or 3, one after the other."""
    for angle, axis in turns:
        c, s = mp.cos(angle), mp.sin(angle)
        x, y, z = v
        v = [c * x - s * y, s * x + c * y, z] if axis == 3 else [x, c * y - s * z, s * y + c * z]
    return v


def on_ellipse(mp: Any, axis: Any, e: Any, mean: Any) -> list[Any]:
    """The place at a mean anomaly, in axes of the orbit: towards the pericentre, ahead, along the normal."""
    anomaly = mp.findroot(lambda x: x - e * mp.sin(x) - mean, mean + e * mp.sin(mean))
    return [axis * (mp.cos(anomaly) - e), axis * mp.sqrt(1 - e * e) * mp.sin(anomaly), mp.mpf(0)]
