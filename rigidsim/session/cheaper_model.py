"""Whether an averaged model would have told what a long run records, and at what part of its steps."""

from __future__ import annotations

from collections.abc import Callable

from rigidsim.errors import ConfigError
from rigidsim.model.loads.gravity_gradient import GravityGradient
from rigidsim.scene.model_table import FULL, REDUCED
from rigidsim.scene.records import dataclass
from rigidsim.solve.problem import InitialValueProblem, prepare

LONG = 1_000_000
"""Steps from which on it is looked at: the windows in which both models are compared have some 2e4, 2e5 at
most."""
NEAR = 1e-5
"""rad: the farthest that axes may be for a model to be advised, two seconds of arc."""


@dataclass(frozen=True)
class CheaperModel:
    """An averaged model for a run that resolved every rotation.

    Attributes:
        level: of ``[model]``, with short-period terms.
        error: of the recorded axes at the end, rad.
        share: of the run's steps that it takes, at most.
    """

    level: str
    error: float
    share: float


def cheaper_model(
    prepared: InitialValueProblem, steps: int, go_on: Callable[[], bool]
) -> CheaperModel | None:
    """The most averaged model that keeps the axes, measured over the beginning of the span.

    Args:
        steps: that the run took.
        go_on: asked again and again; False ends it.

    Returns:
        None where none does, the run is short, or something is recorded that needs every rotation.
    """
    config = prepared.scene.config
    loads = [*prepared.scene.loads, *prepared.python_loads]
    suited = bool(loads) and all(isinstance(load, GravityGradient) for load in loads)
    if steps < LONG or not suited or config.model.level != FULL or config.output.record is None:
        return None
    from rigidsim.accuracy.models.modelling import measure_modelling

    for level in reversed(REDUCED):
        keys = [f'model.level="{level}"', "model.short_period=true"]
        try:
            other = prepare(prepared.experiment.having(keys), loads=prepared.python_loads)
            found = measure_modelling(other, go_on=go_on)
        except ConfigError:  # it has no such average, or records what that doesn't know
            continue
        if found is None:
            return None
        if found.worst <= NEAR:
            beside = found.windows[0]
            return CheaperModel(level, found.worst, beside.reduced_steps / beside.steps)
    return None
