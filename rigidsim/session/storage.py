"""Disk space that a run takes until it is complete, and whether there is enough."""

import math
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from rigidsim.errors import RunFolderError
from rigidsim.scene.readable import bytes_text
from rigidsim.session.dataset import dataset_variables
from rigidsim.solve.problem import InitialValueProblem

_SHRINK = 0.9  # compression ratio of gzip on doubles whose low bits are noise; measured 0.85 to 0.95
_TIMELINE_ROW_BYTES = 260.0  # measured; falls with repeated values


@dataclass(frozen=True)
class Storage:
    """Predicted bytes: per sample, of the segments, which the complete dataset replaces, and of the files."""

    row: float
    segments: float
    dataset: float
    timeline: float
    free: float

    @property
    def needed(self) -> float:
        """Space needed at the end, when all files exist at once."""
        return self.segments + self.dataset + self.timeline

    @property
    def problem(self) -> str | None:
        """Message if there is too little room; None if there is enough."""
        if self.needed <= self.free:
            return None
        sizes = (self.needed, self.segments, self.dataset, self.free)
        needed, segments, dataset, free = map(bytes_text, sizes)
        return (
            f"takes about {needed} of space until it is complete ({segments} of "
            f"segments, {dataset} of dataset.h5), and {free} are free there; take "
            "fewer [time] samples, record less ([output] record), choose a folder on another disk, or, where "
            'a part of it will do, say in [limits] when it may stop, such as wall_time = "1 h"'
        )


def storage(prepared: InitialValueProblem, place: Path) -> Storage:
    """Space that a run would take in a folder, which need not exist; less if a guard or an event ends the
    run.
    """
    samples, output = prepared.clock.count, prepared.scene.config.output
    row = 8.0 * sum(v.parts * math.prod(v.shape) for v in dataset_variables(prepared))
    shown = min(samples, output.timeline_rows) if output.timeline else 0
    there = next(folder for folder in [place.absolute(), *place.absolute().parents] if folder.exists())
    disk = shutil.disk_usage(there)
    replaced = sum(file.stat().st_size for file in place.glob("**/*") if file.is_file())
    return Storage(
        row=row,
        segments=samples * row,
        dataset=samples * row * _SHRINK,
        timeline=shown * _TIMELINE_ROW_BYTES,
        free=disk.free + float(replaced) if disk.total else math.inf,  # one without a size can't tell
    )


def refuse_too_large(prepared: InitialValueProblem, place: Path) -> None:
    """Refuse a run that can only end at its last sample and would fill the disk."""
    limits = prepared.scene.config.limits
    guarded = (limits.wall_time, limits.max_steps, limits.max_drift) != (None, None, None)
    if guarded or any(event.stop for event in prepared.system.events):
        return
    problem = storage(prepared, place).problem
    if problem is not None:
        raise RunFolderError(f"{place}: the run {problem}")


def refuse_too_large_for_memory(prepared: InitialValueProblem) -> None:
    """Refuse a run that would take more memory than there is."""
    row = 8.0 * sum(v.parts * math.prod(v.shape) for v in dataset_variables(prepared))
    needed = 2 * row * prepared.clock.count  # the blocks, and the dataset made of them
    there = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    if needed > there:
        raise RunFolderError(
            f"{prepared.scene.name}: takes about {bytes_text(needed)} of memory, and the machine has "
            f"{bytes_text(there)}; give a folder as out, take fewer samples, or record less ([output] record)"
        )
