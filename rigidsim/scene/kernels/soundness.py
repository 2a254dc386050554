"""Whether a kernel's numbers can be what they are said to be: damage that still reads is refused.

Files of an installed package are held against the SHA-256 that its installer noted; numbers of any kernel
against what is known of the solar system, as coarsely as thousands of years of it allow.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import lru_cache
from importlib import metadata
from pathlib import Path

import numpy as np

from rigidsim.scene.bodies.presets import KNOWN

_AU = 1.495978707e8  # km
_STRENGTHS = {body.name.lower(): body.gravitational_parameter for body in KNOWN}  # m^3/s^2
_SAME_STRENGTH = 2e-3  # relative: kernels of forty years differ by less, and pluto's isn't looked at
_CONSTANTS = {"EMRAT": (81.3, 0.01), "AU": (_AU, 10.0)}
"""With the difference from them that kernels have."""
_PLACES = {  # distance from the barycentre (of the Moon: from the Earth), au
    "sun": (0.0, 0.03), "mercury": (0.28, 0.49), "venus": (0.69, 0.75), "earth": (0.95, 1.05),
    "earth_moon_barycenter": (0.95, 1.05), "moon": (0.95, 1.05), "mars": (1.33, 1.72), "jupiter": (4.8, 5.6),
    "saturn": (8.8, 10.3), "uranus": (18.0, 20.4), "neptune": (29.4, 30.7), "pluto": (29.0, 50.0),
}  # fmt: skip
_MOON = (3.4e5 / _AU, 4.2e5 / _AU)
_PACE = (0.6, 1.5)
"""v^2 r/(G M) of orbits whose eccentricity is at most 0.25: 1 - e to 1 + e, but for what the Sun moves."""
_SAMPLES = 9
_STEP = 1800.0  # s, over which a velocity is taken

At = Callable[[np.ndarray], np.ndarray]
"""Positions (n, 3), km, at times (n,), s since J2000."""


def refuse_exchanged(package: str, path: Path) -> None:
    """Refuse (``ValueError``) a file of a package that isn't the one that was installed, where that is known.

    A package that lies elsewhere, as in a folder of ``PYTHONPATH``, is held against the same SHA-256.
    """
    noted = _noted(package).get(f"{package}/{path.name}")
    if noted is not None and path.is_file():
        found = path.stat()
        if _digest(str(path), found.st_size, found.st_mtime_ns) != noted:
            raise ValueError("its SHA-256 isn't the one that the package's installer noted")


@lru_cache(maxsize=8)
def _noted(package: str) -> dict[str, str]:
    """SHA-256 of an installed package's files, as its ``RECORD`` has them; empty if there is none."""
    try:
        files = metadata.distribution(package).files or []
    except (metadata.PackageNotFoundError, ValueError, OSError):
        return {}
    return {x.as_posix(): x.hash.value for x in files if x.hash is not None and x.hash.mode == "sha256"}


@lru_cache(maxsize=32)
def _digest(path: str, size: int, changed: int) -> str:
    with Path(path).open("rb") as file:
        found = hashlib.file_digest(file, "sha256").digest()
    return base64.urlsafe_b64encode(found).rstrip(b"=").decode()


def refuse_constants(constants: Mapping[str, float], strength: Callable[[str], Fraction | None]) -> None:
    """Refuse (``ValueError``) constants of a package that no kernel has."""
    for key, (expected, slack) in _CONSTANTS.items():
        if key in constants and not abs(constants[key] - expected) <= slack:
            raise ValueError(f"{key} is {constants[key]:.10g}, which is {expected:.10g} in all kernels")
    if not constants["jalpha"] < constants["jomega"]:
        raise ValueError(f"it ends at JD {constants['jomega']}, and begins at {constants['jalpha']}")
    for body, expected in _STRENGTHS.items():
        found = strength(body)
        if found is not None and not abs(float(found) / expected - 1) < _SAME_STRENGTH:
            text = f"G M of {body} is {float(found):.7g} m^3/s^2, which is {expected:.7g}"
            raise ValueError(f"{text} in all kernels")


def refuse_misplaced(body: str, span: tuple[Fraction, Fraction], at: At) -> None:
    """Refuse (``ValueError``) the positions of a body of the solar system from its barycentre, where it never
    is, or that go by faster or slower than it moves.
    """
    if body in _PLACES:
        _refuse_odd(f'"{body}"', span, at, _PLACES[body], None if body == "sun" else _STRENGTHS["sun"])


def refuse_odd_moon(span: tuple[Fraction, Fraction], at: At) -> None:
    """The same of the Moon's positions from the Earth."""
    _refuse_odd('"moon" about "earth"', span, at, _MOON, _STRENGTHS["earth"] + _STRENGTHS["moon"])


def _refuse_odd(
    name: str, span: tuple[Fraction, Fraction], at: At, allowed: tuple[float, float], strength: float | None
) -> None:
    begin, end = map(float, span)
    if not end - begin > 4 * _STEP:
        return
    times = np.linspace(begin, end, _SAMPLES + 2)[1:-1]
    far = np.linalg.norm(at(times), axis=1)
    least, most = far.min() / _AU, far.max() / _AU
    if not (allowed[0] <= least and most <= allowed[1]):
        text = (
            f"{name} is {least:.4g} to {most:.4g} au away, where it is {allowed[0]:.4g} to {allowed[1]:.4g}"
        )
        raise ValueError(text)
    if strength is not None:
        speed = np.linalg.norm(at(times + _STEP) - at(times - _STEP), axis=1) / (2 * _STEP)
        pace = 1e9 * speed**2 * far / strength  # km^3 to m^3
        if not (_PACE[0] < pace.min() and pace.max() < _PACE[1]):
            text = f"{name} moves at {speed.min():.3g} to {speed.max():.3g} km/s, which no orbit there does"
            raise ValueError(text)
