"""Restoring a run's last checkpoint into everything that continues from it."""

from __future__ import annotations

from rigidsim.errors import RunFolderError
from rigidsim.solve.assembly import Assembly
from rigidsim.solve.checkpoint import Checkpoint
from rigidsim.solve.checkpoint_arrays import unpack_checkpoint, unpack_events
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.store import netcdf
from rigidsim.store.segments import Chain, root_attributes


def restore(chain: Chain, prepared: InitialValueProblem, parts: Assembly) -> Checkpoint:
    """Put a checkpoint into the evaluator and event log of fresh parts; the integration and the recorder take
    their state from the returned checkpoint.

    Raises:
        RunFolderError: the checkpoint belongs to another system.
    """
    states = len(prepared.system.states)
    try:
        arrays = netcdf.read_group(chain.paths[-1], "checkpoint")
        names = [invariant.name for invariant in prepared.system.invariants]
        recorded = [variable.name for variable in prepared.system.recorded]
        checkpoint = unpack_checkpoint(arrays, parts.corrected, prepared.precision, names, recorded)
        for path in chain.paths:
            if "previous_seal" in root_attributes(path):
                saved = netcdf.read_group(path, "events")
                parts.log.found += unpack_events(saved, prepared.precision, states)
        position = checkpoint.position
        if position.boundary.mark.events != len(parts.log.found) or position.next_sample != chain.rows:
            raise ValueError("its counts don't agree with what the segments hold")
    except (KeyError, ValueError) as error:
        raise RunFolderError(f"{chain.paths[-1]}: cannot be resumed from: {error}") from None
    parts.evaluator.continuity = checkpoint.continuity
    return checkpoint
