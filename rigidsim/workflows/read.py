"""Reading experiments, those that a run's file embeds among them, once all kinds of loads and all observables
are registered.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import rigidsim.model.earth_frames
import rigidsim.model.loads
import rigidsim.model.partial_invariants
import rigidsim.model.starts
import rigidsim.solve.equilibria  # noqa: F401  (each enters what it defines into a registry of rigidsim.scene)
from rigidsim.errors import ConfigError, Problem, RunFolderError
from rigidsim.scene.config import Experiment, load, parse
from rigidsim.scene.kernels.finding import EMBEDDED, FOLDERS
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.scene import build_scene
from rigidsim.scene.schema import config_model
from rigidsim.scene.validation_messages import shown
from rigidsim.session.dataset import kernel_attributes
from rigidsim.store.netcdf import check_version, root_attributes
from rigidsim.store.provenance import read_attributes

__all__ = ["Experiment", "Given", "as_experiment", "config_model", "load", "parse"]

Given = Experiment | str | Path | Mapping[str, Any]
"""An experiment, the path of its config, or its tables as a dictionary."""


def as_experiment(given: Given, changes: Mapping[str, Any] | None = None) -> Experiment:
    """Convert what is given to an experiment, with some values replaced."""
    if isinstance(given, Mapping):
        given = Experiment.from_dict(given)
    if not isinstance(given, Experiment | str | Path):
        what = f"given {shown(given)}; an experiment, the path of its config, or its tables are allowed"
        raise ConfigError(Problem("experiment", what))
    if not isinstance(given, Experiment):
        return load(given, overrides=changes or {})
    return given.replace(changes) if changes else given


def embedded(dataset: Path, *, overrides: Sequence[str] = ()) -> Experiment:
    """The experiment that a dataset was made from, with the defaults that were in force when the run began;
    ``overrides`` as in ``rigidsim.load``.
    """
    found = root_attributes(dataset)
    check_version(found.get("schema_version"), dataset)
    text, given, settings = (found.get(name) for name in ("config", "config_given", "config_set"))
    if not (isinstance(text, str) and isinstance(given, str) and isinstance(settings, str)):
        raise RunFolderError(f"{dataset}: embeds no config; it is no dataset of rigidsim")
    experiment = parse(text, source=f"{dataset}{EMBEDDED}", overrides=overrides)
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


def refuse_other_kernel(experiment: Experiment, saved: Path) -> None:
    """Refuse to go on from a file with other kernels than those that it was begun with.

    Raises:
        RunFolderError: its bytes differ.
        ConfigError: it is missing, or can't be read.
    """
    if reads_kernels(experiment):
        refuse_others(read_attributes(saved).as_dict(), kernel_attributes(build_scene(experiment)), saved)


def reads_kernels(experiment: Experiment) -> bool:
    """Whether a config names kernels of SPICE or of JPL."""
    return experiment.config.ephemeris is not None or experiment.config.output.orientation is not None


def refuse_others(begun: Mapping[str, Any], now: Mapping[str, Any], place: Path) -> None:
    """Refuse kernels other than those with which something was begun; both as ``kernel_attributes``.

    Raises:
        RunFolderError: the bytes of one differ.
    """
    for kind in ("ephemeris", "orientation"):
        then, found = (known.get(f"{kind}_sha256") for known in (begun, now))
        if then is not None and found is not None and found != then:
            what = f'{place}: begun with a kernel "{begun[f"{kind}_kernel"]}" of SHA-256 {then}, but the one '
            what += f"found is of {found}; put the former in its place, or name its folder in the "
            raise RunFolderError(f"{what}environment variable {FOLDERS}, and remove the other")


def text_difference(one: str, other: str) -> str:
    """The first line in which two texts differ, in words."""
    first, second = one.splitlines(), other.splitlines()
    for number, (a, b) in enumerate(zip(first, second, strict=False), start=1):
        if a != b:
            return f'line {number} is "{a.strip()[:60]}", it was "{b.strip()[:60]}"'
    return f"{len(first)} lines, it had {len(second)}"
