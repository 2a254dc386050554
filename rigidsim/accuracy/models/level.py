"""Choice of the model for a requested accuracy of axes: the most averaged one whose measured error is within
it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from rigidsim.accuracy.models.modelling import measure_modelling
from rigidsim.accuracy.models.side_by_side import Unmeasured
from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load import Load
from rigidsim.scene.choices import AUTO, FULL, ORBIT_AVERAGED, SPIN_AVERAGED
from rigidsim.scene.config import Experiment
from rigidsim.solve.problem import prepare

CHEAPEST_FIRST = (ORBIT_AVERAGED, SPIN_AVERAGED)


@dataclass(frozen=True)
class Considered:
    """A model level that was considered: its modelling error, rad, forecast from the beginning of the span,
    and the CPU time, s, of measuring that after a run; None if there is none.
    """

    level: str
    error: float | None
    why_not: str
    seconds: float | None = None


@dataclass(frozen=True)
class LevelChoice:
    """Result of ``level = "auto"``."""

    experiment: Experiment
    level: str
    considered: Sequence[Considered]


def choose_level(
    experiment: Experiment, *, loads: Sequence[Load] = (), without: Sequence[str] = ()
) -> LevelChoice | None:
    """Choose the model for the requested accuracy of axes, each level measured over the beginning of the
    span; None if the level is given. Raises ``ConfigError`` if no accuracy is asked for.

    Recording something that no average provides, such as a quaternion, leaves the full model, whose attitude
    is then held to the same accuracy.
    """
    config = experiment.config
    if config.model.level != AUTO:
        return None
    asked = _asked(experiment)
    considered: list[Considered] = []
    for level in CHEAPEST_FIRST:
        other = experiment.having([f'model.level="{level}"'])
        why_not = "its measured error was larger than asked for" if level in without else ""
        try:
            found = None if why_not else measure_modelling(prepare(other, loads=loads))
        except ConfigError as error:
            found, why_not = None, "; ".join(p.what for p in error.problems)
        except Unmeasured as why:
            found, why_not = None, str(why)
        if found is None:
            considered.append(Considered(level, None, why_not))
            continue
        kept = found.worst <= asked
        why_not = "" if kept else "more than asked for"
        considered.append(Considered(level, found.worst, why_not, found.seconds_of_run))
        if kept:
            return LevelChoice(other, level, considered)
    considered.append(Considered(FULL, 0.0, ""))
    return LevelChoice(fully(experiment), FULL, considered)


def fully(experiment: Experiment) -> Experiment:
    """An experiment with its open level set to the full model; others unchanged. Raises ``ConfigError``."""
    if experiment.config.model.level != AUTO:
        return experiment
    _asked(experiment)
    return experiment.having([f'model.level="{FULL}"'])


def _asked(experiment: Experiment) -> float:
    asked = experiment.config.integrator.accuracy_axis
    if asked is None:
        what = (
            'given "auto", but [integrator] accuracy_axis says no error to hold; give it, or choose a level'
        )
        raise ConfigError(Problem("[model] level", what), experiment.source)
    return float(asked)
