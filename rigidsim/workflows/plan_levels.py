"""Comparison of model levels, cost and error: ``plan``'s part on ``[model]``."""

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from rigidsim.accuracy.choice import CHEAPEST_FIRST, LevelChoice
from rigidsim.accuracy.modelling import Unmeasured, measure_modelling
from rigidsim.accuracy.motion import Pilot, run_pilot
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.average import reads_rates_alone
from rigidsim.model.load import Load
from rigidsim.scene.choices import FULL
from rigidsim.scene.config import Experiment
from rigidsim.solve.assembly import assemble
from rigidsim.solve.corrected_stepper import CorrectedStepper
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.store.summary import SummaryPart

_PILOT_SECONDS = 0.2
_LARGEST_CHUNK = 1024  # steps: at this length a call's overhead is negligible


class LevelCost(SummaryPart):
    """What a level of ``[model]`` would cost, from a short pilot, and leave out: the modelling error of axes,
    forecast from the beginning, and the CPU time of measuring it after a run; why it isn't chosen, empty for
    the one that is. None where something isn't known, or there is no such average.
    """

    level: str
    error_rad: float | None
    steps: float | None
    cpu_seconds: float | None
    modelling_seconds: float | None
    why_not: str


def compared_levels(
    experiment: Experiment, choice: LevelChoice | None, loads: Sequence[Load] = ()
) -> list[LevelCost]:
    """All levels, the cheapest first, if the config says anything about models; a choice isn't measured
    again.
    """
    if "model" not in experiment.config.model_fields_set:
        return []
    asked = choice.level if choice else experiment.config.model.level
    looked_at = {row.level: row for row in choice.considered} if choice else {}
    found = []
    for level in (*CHEAPEST_FIRST, FULL):
        unknown = dict.fromkeys(("error_rad", "steps", "cpu_seconds", "modelling_seconds"))
        row: dict[str, Any] = {"level": level, **unknown}
        known = looked_at.get(level)
        try:
            prepared = prepare(experiment.having([f'model.level="{level}"']), loads=loads)
        except ConfigError as error:
            found.append(LevelCost(**row, why_not="; ".join(problem.what for problem in error.problems)))
            continue
        pilot = timed_pilot(prepared, assemble(prepared).steps(), _PILOT_SECONDS)
        steps = math.ceil(pilot.whole)
        row |= {"steps": float(steps), "cpu_seconds": steps * pilot.seconds_per_step}
        if level == FULL:
            row["error_rad"] = 0.0
        elif known is not None:
            row |= {"error_rad": known.error, "modelling_seconds": known.seconds}
        else:
            with suppress(Unmeasured):
                measured = measure_modelling(prepared)
                row |= {"error_rad": measured.worst, "modelling_seconds": measured.seconds_of_run}
        why = known.why_not if known is not None else "" if level == asked else "another level is cheaper"
        found.append(LevelCost(**row, why_not=why if choice or level == asked else "not asked for"))
    return found


def timed_pilot(prepared: InitialValueProblem, corrected: CorrectedStepper, seconds: float) -> Pilot:
    """The first steps of a motion, corrections included, within so many CPU seconds."""
    return run_pilot(
        corrected.stepper,
        prepared.clock,
        corrected.skip,
        seconds=seconds,
        chunk=1,
        largest_chunk=_LARGEST_CHUNK,
    )


def torques_change_pace(prepared: InitialValueProblem, pilot: Pilot) -> bool:
    """Whether steps get longer or shorter after the pilot's, since torques that are functions of the rates
    brake the rotation, or spin it up.
    """
    plan, clock = prepared.system.plan, prepared.clock
    alone = [load for load in plan.loads if load.gradient_source is None]
    braked = plan.formulation.resolves_rotation and alone and all(map(reads_rates_alone, alone))
    ahead = pilot.taken * pilot.step < float(clock.at(clock.count - 1)) - float(clock.start)
    return bool(prepared.has_steps and braked and ahead)
