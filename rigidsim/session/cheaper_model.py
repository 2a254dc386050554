"""Whether an averaged model would have given what a long run records, and at what share of its steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rigidsim.errors import ConfigError
from rigidsim.model.capabilities import gradient_source_of
from rigidsim.scene.model_table import FULL, REDUCED
from rigidsim.session.tuning import AdviceLimits
from rigidsim.solve.problem import InitialValueProblem, prepare


@dataclass(frozen=True)
class CheaperModel:
    """An averaged model that could replace a run that resolved every rotation.

    Attributes:
        error: error of the recorded axes at the end, rad.
        share: largest share of the run's steps that it would take.
    """

    level: str
    error: float
    share: float


def cheaper_model(
    prepared: InitialValueProblem, steps: int, limits: AdviceLimits, go_on: Callable[[], bool]
) -> CheaperModel | None:
    """The most averaged model that keeps the axes accurate, measured over the beginning of the run.

    Args:
        steps: steps that the run took.
        limits: which runs are examined, and which models are advised.
        go_on: polled repeatedly; False ends the comparison.

    Returns:
        None if no model does, the run is short, or something recorded needs every rotation.
    """
    config = prepared.scene.config
    loads = prepared.system.plan.loads
    suited = bool(loads) and all(gradient_source_of(load) is not None for load in loads)
    if steps < limits.steps or not suited or config.model.level != FULL or config.output.record is None:
        return None
    from rigidsim.accuracy.models.modelling import measure_modelling
    from rigidsim.accuracy.models.side_by_side import Unmeasured

    for level in reversed(REDUCED):
        keys = [f'model.level="{level}"', "model.short_period=true"]
        try:
            other = prepare(prepared.experiment.having(keys), loads=prepared.python_loads)
            found = measure_modelling(other, go_on=go_on)
        except ConfigError:  # no such average exists, or it can't provide what is recorded
            continue
        except Unmeasured:
            return None
        if found.worst <= limits.apart:
            beside = found.windows[0]
            return CheaperModel(level, found.worst, beside.reduced_steps / beside.steps)
    return None
