"""The experiment that a run's file embeds, with the defaults that were in force when the run began."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rigidsim.errors import RunFolderError
from rigidsim.scene.config import Experiment, parse
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.store.netcdf import check_version, root_attributes
from rigidsim.store.provenance import read_attributes


def embedded(dataset: Path, *, overrides: Sequence[str] = ()) -> Experiment:
    """The experiment that a dataset was made from; ``overrides`` as in ``rigidsim.load``."""
    found = root_attributes(dataset)
    check_version(found.get("schema_version"), dataset)
    text, given, settings = (found.get(name) for name in ("config", "config_given", "config_set"))
    if not (isinstance(text, str) and isinstance(given, str) and isinstance(settings, str)):
        raise RunFolderError(f"{dataset}: embeds no config; it is no dataset of rigidsim")
    experiment = parse(text, source=f"{dataset} (embedded config)", overrides=overrides)
    return replace(experiment, given=given, settings=(*settings.splitlines(), *experiment.settings))


def as_begun(experiment: Experiment, saved: Path) -> Experiment:
    """The experiment with what its begun run records made explicit where the config leaves it open; the text
    stays as it is.
    """
    output, recorded = experiment.config.output, read_attributes(saved).recorded
    if output.record is not None or not recorded:
        return experiment
    known = {*OBSERVABLES, *(table.name for table in experiment.config.states)}
    names = [name for name in recorded.split() if name in known]
    config = experiment.config.model_copy(update={"output": output.model_copy(update={"record": names})})
    return replace(experiment, config=config)


def text_difference(one: str, other: str) -> str:
    """The first line in which two texts differ, in words."""
    first, second = one.splitlines(), other.splitlines()
    for number, (a, b) in enumerate(zip(first, second, strict=False), start=1):
        if a != b:
            return f'line {number} is "{a.strip()[:60]}", it was "{b.strip()[:60]}"'
    return f"{len(first)} lines, it had {len(second)}"
