"""Validation only: whether a config could be run, and how it was understood."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rigidsim.accuracy.choice import fully
from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.sweep import Sweep
from rigidsim.session.dataset import refuse_taken_names
from rigidsim.session.understood import cautions_of, understood
from rigidsim.solve.problem import prepare
from rigidsim.store.summary import Understood, as_fields
from rigidsim.workflows.read import load
from rigidsim.workflows.sweeps.members import recording
from rigidsim.workflows.sweeps.plan import QUICK, check_sweep


class Checked(Understood):
    """Result of a check: problems, warnings, and how a config that can be run was understood; ``as_dict``
    gives what ``--json`` prints.
    """

    source: str
    valid: bool
    problems: list[Problem]


def check(path: str | Path, *, overrides: Sequence[str] = ()) -> Checked:
    """Validate a config as far as ``run`` would before its first step, and write nothing."""
    try:
        experiment = load(path, overrides=overrides)
        if experiment.config.sweep is None:
            prepared = prepare(fully(experiment))
            refuse_taken_names(prepared)
        else:
            found = recording(Sweep.of(experiment))
            prepared = check_sweep(found, most=QUICK)
    except ConfigError as error:
        unknown: dict[str, Any] = dict.fromkeys(("body", "start", "time"))
        given = error.source or str(path)
        return Checked(
            source=given, valid=False, problems=error.problems, **as_fields([]), **unknown, loads=()
        )
    return Checked(
        source=str(path), valid=True, problems=[], **as_fields(cautions_of(prepared.scene)),
        **understood(prepared),
    )  # fmt: skip
