"""A checkpoint: what a run continues from, each part packed and restored by itself, under a version."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from rigidsim.solve.checkpoint_arrays import Arrays
from rigidsim.solve.corrected_stepper import StepBoundary

_VERSION, _REGISTERED = "version_", "registered_"


@dataclass(frozen=True)
class Position:
    """Position from which a run continues with the same bits.

    Attributes:
        boundary: a step boundary past all samples before ``next_sample``.
        next_sample: index of the first sample that isn't handed over.
    """

    boundary: StepBoundary
    next_sample: int


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
    found = {name: int(n[0]) for name, n in arrays.items() if name.startswith(_VERSION)}
    found = {name.removeprefix(_VERSION): version for name, version in found.items()}
    # a part that an older checkpoint lacks begins anew
    found = {name: 1 for name in versions if not name.startswith(_REGISTERED)} | found
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
