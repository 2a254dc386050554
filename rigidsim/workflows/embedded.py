"""The experiment that a run's file embeds, with the defaults that were in force when the run began."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rigidsim.errors import RunFolderError
from rigidsim.scene.config import Experiment, parse, parse_earlier
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.store.attributes import RootAttributes, read_attributes
from rigidsim.store.netcdf import root_attributes
from rigidsim.store.reader import open_dataset

_WITHOUT_DIRECTIONS = 4
"""Earlier schema versions recorded no axes, their angles or polar motion by default, and don't say what they
record.
"""


def embedded(dataset: Path, *, overrides: Sequence[str] = ()) -> Experiment:
    """The experiment that a dataset was made from; ``overrides`` as in ``rigidsim.load``."""
    found = root_attributes(dataset)
    text, given, settings = (found.get(name) for name in ("config", "config_given", "config_set"))
    if not isinstance(text, str):
        raise RunFolderError(f"{dataset}: embeds no config; it is no dataset of rigidsim")
    source = f"{dataset} (embedded config)"
    if not isinstance(given, str) or not isinstance(settings, str):
        return parse_earlier(text, source=source, overrides=overrides)
    experiment = parse(text, source=source, overrides=overrides)
    return replace(experiment, given=given, settings=(*settings.splitlines(), *experiment.settings))


def as_begun(experiment: Experiment, saved: Path) -> Experiment:
    """The experiment with the recording and projection of its begun run made explicit where the config leaves
    them open; the text stays as it is.
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


def text_difference(one: str, other: str) -> str:
    """The first line in which two texts differ, in words."""
    first, second = one.splitlines(), other.splitlines()
    for number, (a, b) in enumerate(zip(first, second, strict=False), start=1):
        if a != b:
            return f'line {number} is "{a.strip()[:60]}", it was "{b.strip()[:60]}"'
    return f"{len(first)} lines, it had {len(second)}"
