"""A run's last checkpoint, put back into everything that goes on from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.prepare import Prepared
from rigidsim.solve.evaluate import Evaluator
from rigidsim.solve.events import EventLog
from rigidsim.solve.harvest import Checkpoint
from rigidsim.solve.packing import unpack_checkpoint, unpack_events
from rigidsim.solve.rhythm import Rhythm
from rigidsim.store import netcdf
from rigidsim.store.segments import Chain, root_attributes


@dataclass(frozen=True)
class Resumed:
    """The checkpoint of the last segment, and its arrays."""

    checkpoint: Checkpoint
    arrays: Mapping[str, np.ndarray]


def restore(chain: Chain, prepared: Prepared, rhythm: Rhythm, evaluator: Evaluator, log: EventLog) -> Resumed:
    """Put a checkpoint into a fresh evaluator and event log; the integration takes it from the result.

    Raises:
        RunFolderError: the checkpoint belongs to another system.
    """
    states = len(prepared.system.states)
    try:
        arrays = netcdf.read_group(chain.paths[-1], "checkpoint")
        checkpoint, memory = unpack_checkpoint(arrays, prepared.precision, rhythm.place().memories, states)
        for path in chain.paths:
            if "previous_seal" in root_attributes(path):
                saved = netcdf.read_group(path, "events")
                log.found += unpack_events(saved, prepared.precision, states)
        if checkpoint.place.mark.events != len(log.found) or checkpoint.next_sample != chain.rows:
            raise ValueError("its counts don't agree with what the segments hold")
    except (KeyError, ValueError) as error:
        raise RunFolderError(f"{chain.paths[-1]}: can't be gone on from: {error}") from None
    evaluator.memory = memory
    return Resumed(checkpoint, arrays)
