"""A checkpoint: what a run continues from, each part packed and restored by itself, under a version.

Its numbers are plain arrays, exact in every bit: reading them back runs no code. A number beyond double is
2^exponent times a sum of float64 parts. Arrays without elements aren't saved.
"""

from collections.abc import Mapping
from typing import ClassVar, Protocol

import mpmath
import numpy as np

from rigidsim.solve.precision import Precision, Scalar

Arrays = dict[str, np.ndarray]
"""Float64 or int64 arrays by name."""

_STEP = 512  # a power of two that every type holds


def pack(values: np.ndarray, precision: Precision, name: str) -> Arrays:
    """Scalars (n,) as exact arrays ``NAME_parts`` (parts, n) and, beyond double, ``NAME_exponents`` (n,)."""
    if precision.narrow:
        return {f"{name}_parts": np.asarray(values, dtype=np.float64)[None, :]}
    exponents = np.zeros(len(values), dtype=np.int64)
    scaled = np.array(values, dtype=precision.scalar)
    up, down = _power(precision, _STEP), _power(precision, -_STEP)
    for i in range(len(scaled)):  # scale to a size whose residuals are no denormal doubles
        while scaled[i] != 0 and abs(scaled[i]) < down:
            scaled[i] = scaled[i] * up
            exponents[i] -= _STEP
    return {f"{name}_exponents": exponents, f"{name}_parts": np.stack(precision.parts(scaled))}


def unpack(arrays: Mapping[str, np.ndarray], precision: Precision, name: str) -> np.ndarray:
    """Scalars restored from packed arrays; raises a ValueError for another shape or precision."""
    if f"{name}_parts" not in arrays:
        return precision.zeros((0,))
    parts = np.asarray(arrays[f"{name}_parts"], dtype=np.float64)
    if parts.ndim != 2 or len(parts) != precision.part_count:
        raise ValueError(f"{name} has parts of shape {parts.shape}")
    if precision.narrow:
        return parts[0].astype(precision.scalar)
    total = precision.of_doubles(parts[0])
    for part in parts[1:]:
        total = total + precision.of_doubles(part)
    exponents = np.asarray(arrays[f"{name}_exponents"])
    if exponents.shape != total.shape:
        raise ValueError(f"{name} has exponents of shape {exponents.shape}")
    down = _power(precision, -_STEP)
    for i, exponent in enumerate(exponents):
        for _ in range(-int(exponent) // _STEP):
            total[i] = total[i] * down
    return total


def _power(precision: Precision, exponent: int) -> Scalar:
    return precision.number(mpmath.mpf(2) ** exponent)


def numbers(arrays: Mapping[str, np.ndarray], name: str, count: int) -> list[float]:
    """So many numbers of an array; raises a KeyError if it is missing, a ValueError if it has others."""
    found = np.asarray(arrays[name])
    if found.shape != (count,):
        raise ValueError(f"the checkpoint has {name} of shape {found.shape}, not ({count},)")
    return [x.item() for x in found]


_VERSION, _REGISTERED = "version_", "registered_"


class SavedPart(Protocol):
    """A part of what a run continues from.

    Attributes:
        version: of its arrays; an older checkpoint is refused.
    """

    version: ClassVar[int]

    def pack(self) -> Arrays:
        """It as arrays, with names that no other part uses."""

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Continue from what was packed.

        Raises:
            KeyError, ValueError: it belongs to another system.
        """


def pack_versions(versions: Mapping[str, int]) -> Arrays:
    """Versions by the names of parts."""
    return {_VERSION + name: np.array([version]) for name, version in versions.items()}


def check_versions(arrays: Mapping[str, np.ndarray], versions: Mapping[str, int]) -> None:
    """Raise a ValueError, with what to do, for a checkpoint of other parts or other versions of them."""
    found = {n.removeprefix(_VERSION): int(v[0]) for n, v in arrays.items() if n.startswith(_VERSION)}
    if not found:
        raise ValueError(
            "an earlier version of rigidsim began it; resume it with that version, or begin a new run"
        )
    for name in sorted(found.keys() ^ versions.keys()):
        title = name.removeprefix(_REGISTERED)
        if name in found:
            raise ValueError(f'it was saved with "{title}", which is missing here; import what registers it')
        raise ValueError(f'it was saved without "{title}", which is registered here; resume it without that')
    for name, version in versions.items():
        if found[name] != version:
            raise ValueError(
                f'it holds version {found[name]} of "{name.removeprefix(_REGISTERED)}", and here is version '
                f"{version}; resume it with the code that began it, or begin a new run"
            )
