"""Reading experiments, those that a run's file embeds among them, once all kinds of loads and all observables
are registered.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import rigidsim.formats.message_starts
import rigidsim.model.loads
import rigidsim.model.observables.mechanical
import rigidsim.solve.equilibria
import rigidsim.solve.local_frames
import rigidsim.solve.pair_equilibria  # noqa: F401  (each enters what it defines into a registry below)
from rigidsim.errors import ConfigError, Problem, RunFolderError, run_again
from rigidsim.scene.config import Experiment, Overrides, parse
from rigidsim.scene.config import load as load_file
from rigidsim.scene.kernels.reading import EMBEDDED, FOLDERS
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.scene import build_scene
from rigidsim.scene.schema import config_model
from rigidsim.scene.validation_messages import nearest, shown
from rigidsim.session.dataset import kernel_attributes
from rigidsim.store.netcdf import check_version, root_attributes
from rigidsim.store.provenance import read_attributes

__all__ = ["Experiment", "Given", "as_experiment", "config_model", "load", "parse"]

Given = Experiment | str | Path | Mapping[str, Any]
"""An experiment, the path of its config or the name of a ready scene, or its tables as a dictionary."""


def load(path: str | Path, *, overrides: Overrides = ()) -> Experiment:
    """Read a config file, or a ready scene by its name (``"coin"``), with the table files that it names.

    An existing file comes before a scene. An experiment is named as its scene was asked for.

    Args:
        path: of the config, or a name that the command ``rigidsim new`` lists.
        overrides: as for ``parse``.

    Raises:
        ConfigError: neither is given; or the file is missing, not text, too large, or a bad config.
    """
    if not isinstance(path, str | Path) or os.path.lexists(path):
        return load_file(path, overrides=overrides)
    from rigidsim.workflows.ready_scenes import ALIASES, ready_scenes  # which files don't need

    name, scenes = str(path), ready_scenes()
    scene = scenes.get(ALIASES.get(name.lower(), name))
    if scene is None:
        if hint := nearest(Path(name).stem, [*scenes, *ALIASES]):
            what = f"there is no such file, nor a ready scene of this name{hint}; the command rigidsim new "
            raise ConfigError(Problem("file", what + "lists all scenes"), name)
        return load_file(path, overrides=overrides)
    if name != scene.stem:
        if isinstance(overrides, Mapping):
            overrides = {"name": name, **overrides}
        else:
            overrides = [f'name="{name}"', *overrides]
    return load_file(scene, overrides=overrides)


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
    try:
        found = root_attributes(dataset)
    except RunFolderError as error:
        raise RunFolderError(f"{error}; {run_again(dataset.parent)}") from None
    check_version(found.get("schema_version"), dataset)
    text, given, settings = (found.get(name) for name in ("config", "config_given", "config_set"))
    if not (isinstance(text, str) and isinstance(given, str) and isinstance(settings, str)):
        raise RunFolderError(f"{dataset}: embeds no config; it is no dataset of rigidsim")
    experiment = parse(text, source=f"{dataset}{EMBEDDED}", overrides=overrides)
    return replace(experiment, given=given, settings=(*settings.splitlines(), *experiment.settings))


def with_recorded_variables_of(experiment: Experiment, saved: Path) -> Experiment:
    """The experiment with what its begun run records made explicit where the config leaves it open; the text
    stays as it is.
    """
    output, recorded = experiment.config.output, read_attributes(saved).get("recorded")
    if output.record is not None or not recorded:
        return experiment
    known = {*OBSERVABLES, *(table.name for _, _, table in experiment.config.every_state)}
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
        refuse_others(read_attributes(saved), kernel_attributes(build_scene(experiment)), saved)


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
