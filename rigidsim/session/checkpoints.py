"""A run's checkpoints: packed whenever samples are saved, and put back into all that continues from one."""

from __future__ import annotations

import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.solve.assembly import Assembly
from rigidsim.solve.checkpoint import Position, SavedPart, check_versions, pack_versions
from rigidsim.solve.checkpoint_arrays import Arrays, numbers
from rigidsim.solve.events import pack_events, unpack_events
from rigidsim.store import netcdf
from rigidsim.store.segments import Chain


class Checkpoints:
    """Packs and restores stepper, effects, events, and other parts that samples and counts depend on."""

    def __init__(self, parts: Assembly, **others: SavedPart) -> None:
        self._precision, self._system = parts.prepared.precision, parts.prepared.system
        self._corrected, self._log = parts.corrected, parts.log
        self._parts: dict[str, SavedPart] = {"continuity": parts.evaluator, **others}
        self._versions = self._corrected.versions | {name: part.version for name, part in self._parts.items()}

    def packed(self, position: Position) -> Arrays:
        """Everything at a position, as arrays."""
        arrays = self._corrected.pack(position.boundary)
        arrays["counts"] = np.append(arrays["counts"], position.next_sample)
        for part in self._parts.values():
            arrays |= part.pack()
        return arrays | pack_versions(self._versions)

    def events(self, position: Position, first: int = 0) -> Arrays:
        """Crossings from number ``first`` on up to a position; later ones are found again."""
        return pack_events(self._log.found[first : position.boundary.mark.events], self._precision)

    def restore(self, chain: Chain) -> Position:
        """Put the last checkpoint back."""
        try:
            arrays = netcdf.read_group(chain.paths[-1], "checkpoint")
            check_versions(arrays, self._versions)
            boundary, next_sample = self._corrected.unpack(arrays), int(numbers(arrays, "counts", 3)[2])
            for part in self._parts.values():
                part.restore(arrays)
            for path in chain.paths:
                if "previous_seal" in netcdf.root_attributes(path):
                    saved = netcdf.read_group(path, "events")
                    self._log.found += unpack_events(saved, self._precision, len(self._system.states))
            if boundary.mark.events != len(self._log.found) or next_sample != chain.rows:
                raise ValueError("its counts don't agree with what the segments hold")
        except (KeyError, ValueError) as error:
            raise RunFolderError(f"{chain.paths[-1]}: cannot be resumed from: {error}") from None
        return Position(boundary, next_sample)
