"""Defaults that were in force when a run began, if they have changed since."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rigidsim.scene.config import Experiment
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.store.attributes import RootAttributes, read_attributes
from rigidsim.store.reader import open_dataset

_WITHOUT_DIRECTIONS = 4
"""Earlier schema versions recorded no axes, their angles or polar motion by default, and don't say what they
record.
"""


def as_begun(experiment: Experiment, saved: Path) -> Experiment:
    """The experiment with the recording and projection of its begun run made explicit where the config leaves
    them open; the text stays as it is.

    Args:
        saved: a file of the run, which tells; one of an earlier version tells by its contents.
    """
    found = read_attributes(saved)
    experiment = _projecting(experiment, found)
    output = experiment.config.output
    if output.record is not None:
        return experiment
    if found.recorded:
        names = [name for name in found.recorded.split() if name in OBSERVABLES]
    elif found.schema_version < _WITHOUT_DIRECTIONS:
        with open_dataset(saved, indexed=False) as dataset:
            names = [name for name in OBSERVABLES if name in dataset.variables]
    else:
        return experiment
    config = experiment.config.model_copy(update={"output": output.model_copy(update={"record": names})})
    return replace(experiment, config=config)


def _projecting(experiment: Experiment, found: RootAttributes) -> Experiment:
    """Set ``hold_invariants`` to false if the config leaves it open and the run began before "auto" was its
    default.
    """
    integrator = experiment.config.integrator
    if "hold_invariants" in integrator.model_fields_set or found.hold_invariants:
        return experiment
    plain = integrator.model_copy(update={"hold_invariants": False})
    return replace(experiment, config=experiment.config.model_copy(update={"integrator": plain}))
