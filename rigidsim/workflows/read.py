"""Reading experiments once all kinds of loads and all observables are registered."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rigidsim.model.loads
import rigidsim.model.partial_invariants
import rigidsim.model.starts
import rigidsim.solve.equilibria  # noqa: F401  (each enters what it defines into a registry of rigidsim.scene)
from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.config import Experiment, load, parse
from rigidsim.scene.schema import config_model
from rigidsim.scene.validation_messages import shown

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
