"""Validation only: whether a config could be run, and how it was understood."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigidsim.accuracy.models.level import fully
from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.session.dataset import refuse_taken_names
from rigidsim.session.understood import body_of, cautions_of, span_of, start_of, told_loads
from rigidsim.solve.problem import prepare
from rigidsim.store.summary import Span, Start, UnderstoodBody
from rigidsim.store.summary_parts import Caution
from rigidsim.workflows.read import load
from rigidsim.workflows.sweeps.members import recording
from rigidsim.workflows.sweeps.plan import QUICK, check_sweep


@dataclass(frozen=True)
class Checked:
    """Result of a check: problems, cautions, and how a config that can be run was understood."""

    source: str
    problems: tuple[Problem, ...] = ()
    cautions: tuple[Caution, ...] = ()
    body: UnderstoodBody | None = None
    start: Start | None = None
    time: Span | None = None
    loads: tuple[str, ...] = ()

    @property
    def valid(self) -> bool:
        """Whether the config can be run."""
        return not self.problems

    def as_dict(self) -> dict[str, Any]:
        """Values for JSON."""
        return {
            "source": self.source,
            "valid": self.valid,
            "problems": [{"where": problem.where, "what": problem.what} for problem in self.problems],
            "warnings": [caution.text for caution in self.cautions],
            "warning_codes": [caution.code.value for caution in self.cautions],
            "body": None if self.body is None else self.body.as_dict(),
            "start": None if self.start is None else self.start.as_dict(),
            "time": None if self.time is None else self.time.as_dict(),
            "loads": list(self.loads),
        }


def check(path: str | Path, *, overrides: Sequence[str] = ()) -> Checked:
    """Validate a config as far as ``run`` would before its first step, and write nothing.

    Args:
        overrides: ``KEY=VALUE`` texts, as for ``rigidsim.load``.
    """
    try:
        experiment = load(path, overrides=overrides)
        if experiment.config.sweep is None:
            prepared = prepare(fully(experiment))
            refuse_taken_names(prepared)
        else:
            found = recording(Sweep.of(experiment))
            prepared = check_sweep(found, every=found.count <= QUICK)
    except ConfigError as error:
        return Checked(error.source or str(path), problems=tuple(error.problems))
    scene = prepared.scene
    cautions = tuple(cautions_of(scene))
    parts = body_of(scene), start_of(scene), span_of(scene)
    return Checked(str(path), (), cautions, *parts, told_loads(prepared))
