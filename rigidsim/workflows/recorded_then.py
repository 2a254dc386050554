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
"""Schema versions below this one recorded neither axes and their angles nor polar motion by default."""


def as_recorded(experiment: Experiment, saved: Path) -> Experiment:
    """The experiment that records what a file of its run holds, where its config names nothing and the file
    is of an earlier version; the text stays as it is.
    """
    output = experiment.config.output
    if output.record is not None or read_attributes(saved).schema_version >= _WITHOUT_DIRECTIONS:
        return experiment
    with netcdf.reading(saved) as file:
        names = [name for name in OBSERVABLES if isinstance(file.get(name), h5py.Dataset)]
    config = experiment.config.model_copy(update={"output": output.model_copy(update={"record": names})})
    return replace(experiment, config=config)
