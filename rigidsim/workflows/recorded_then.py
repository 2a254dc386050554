"""What a run recorded by default when it began, where that was less than it would be now."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py

from rigidsim.scene.config import Experiment
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.store import netcdf
from rigidsim.store.attributes import read_attributes

_WITHOUT_DIRECTIONS = 4
"""Schema versions below this one recorded no axes, angles of axes and polar motion by default, and don't
say what they record."""


def as_recorded(experiment: Experiment, saved: Path) -> Experiment:
    """The experiment that records what its run does, where its config names nothing; the text stays as it is.

    Args:
        saved: a file of the run, which says so, or of an earlier version, which holds it.
    """
    output, found = experiment.config.output, read_attributes(saved)
    if output.record is not None:
        return experiment
    if found.recorded:
        names = [name for name in found.recorded.split() if name in OBSERVABLES]
    elif found.schema_version < _WITHOUT_DIRECTIONS:
        with netcdf.reading(saved) as file:
            names = [name for name in OBSERVABLES if isinstance(file.get(name), h5py.Dataset)]
    else:
        return experiment
    config = experiment.config.model_copy(update={"output": output.model_copy(update={"record": names})})
    return replace(experiment, config=config)
