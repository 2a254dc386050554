"""``rigidsim plan``: what would be integrated and why, and what it will cost, from a short pilot."""

import math
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.accuracy.choice import (
    CHEAPEST_FIRST,
    LevelChoice,
    Pilot,
    choose_level,
    chosen,
    growth_of,
    run_pilot,
)
from rigidsim.accuracy.estimates import closed_form_if_any, held_error, stable_law
from rigidsim.accuracy.modelling import Unmeasured, measure_modelling
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.average import reads_rates_alone
from rigidsim.model.equation_text import equation_texts
from rigidsim.model.load import Load
from rigidsim.scene.choices import FULL
from rigidsim.scene.config import Experiment
from rigidsim.session.dataset import dataset_variables, refuse_taken_names, unused_variables
from rigidsim.session.session import storage
from rigidsim.session.understood import cautions_of, understood
from rigidsim.solve.assembly import Assembly, assemble
from rigidsim.solve.corrected_stepper import CorrectedStepper
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.projection import LATE
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.store.segments import SegmentLimits
from rigidsim.store.summary import SummaryPart, Understood
from rigidsim.workflows.read import Given, as_experiment

_LEVEL_SECONDS = 0.2
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
            prepared = prepare(experiment.with_overrides([f'model.level="{level}"']), loads=loads)
        except ConfigError as error:
            found.append(LevelCost(**row, why_not="; ".join(problem.what for problem in error.problems)))
            continue
        pilot = timed_pilot(prepared, assemble(prepared).steps(), _LEVEL_SECONDS)
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
        prepared,
        corrected,
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


_PILOT_SECONDS = 0.5
_BASE_MEMORY = 170e6  # interpreter, libraries and compiled code
_COMPRESSION = 2.5e-8  # seconds a byte: gzip 4 with shuffle writes about 40 MB/s
_BUFFERING = 2e-7  # seconds per sample
_EVALUATED = {True: 4096, False: 16}  # samples to evaluate, in precisions with cheap arithmetic and without


class StatesWhy(SummaryPart):
    """States that are integrated, and why."""

    states: str
    why: str


class LeftOut(SummaryPart):
    """What isn't modelled, and why."""

    what: str
    why: str


class PlannedSurface(SummaryPart):
    """A kink or jump on which steps end, and the load that has it."""

    surface: str
    where: str


class PlannedInvariant(SummaryPart):
    """An invariant, and why it is one; numerical: constant by definition, whatever the motion."""

    name: str
    why: str
    numerical: bool


class PlannedSetting(SummaryPart):
    """The setting chosen for the accuracy asked for, and its forecast error."""

    chosen: str
    why: str
    forecast: float | None


class PilotCosts(SummaryPart):
    """What a short pilot measured: steps, their mean length (s), and seconds of CPU time."""

    steps: float
    step: float
    seconds_per_step: float
    seconds_per_sample: float


class Predicted(SummaryPart):
    """The forecast cost of a run, and its errors.

    Attributes:
        pace: 1, or None if torques change the length of steps after the pilot's.
        modelling_seconds: CPU time of the full model next to an averaged one.
        free_bytes: free space on the disk; infinite if unknown.
        attitude_error_rad: None without an attitude, or if the method reports its own errors; ``held``:
            whether it is with projected invariants.
        amplification, growth_seconds: of rounding errors by the end; span over which that was followed.
    """

    steps: float
    pace: float | None
    integration_seconds: float
    recording_seconds: float
    building_seconds: float
    choosing_seconds: float
    modelling_seconds: float
    total_seconds: float
    memory_bytes: float
    segment_bytes: float
    dataset_bytes: float
    timeline_bytes: float
    free_bytes: float
    attitude_error_rad: float | None
    held: bool
    amplification: float
    growth_seconds: float | None


class RunPlan(Understood):
    """What would be integrated and why, and what it would cost; ``as_dict`` gives what ``--json`` prints.

    Attributes:
        shared_terms, equations: as of ``rigidsim.model.equation_text``.
        internal_units: by quantity, in s and kg m^2.
        closed_form, closed_form_why_not: its title, or why there is none.
        hold_from_step: natural steps after which invariants are projected; None if from the start.
        levels: levels of ``[model]``, the cheapest first; empty if the config says nothing about models.
        accuracy: None if no accuracy is asked for.
    """

    name: str
    formulation: str
    euler_sequence: str | None
    euler_partner_sequence: str | None
    states: list[str]
    state_count: int
    reasons: list[StatesWhy]
    left_out: list[LeftOut]
    switching: list[PlannedSurface]
    turning: list[str]
    shared_terms: list[str]
    equations: list[str]
    internal_units: dict[str, float]
    recorded: list[str]
    invariants: list[PlannedInvariant]
    precision: str
    tolerance: float
    method: str
    closed_form: str | None
    closed_form_why_not: str | None
    hold_invariants: bool
    hold_from_step: int | None
    levels: list[LevelCost]
    accuracy: PlannedSetting | None
    taylor_order: int | None
    pilot: PilotCosts
    predicted: Predicted

    def __repr__(self) -> str:
        cost = self.predicted
        return (
            f"<Plan of {self.name!r}: {self.state_count} states, {self.formulation}, about {cost.steps:.3g} "
            f"steps in {cost.total_seconds:.3g} s>"
        )


def plan(
    experiment: Given,
    *,
    changes: Mapping[str, Any] | None = None,
    loads: Sequence[Load] = (),
    out: str | Path = "runs",
    pilot_seconds: float = _PILOT_SECONDS,
) -> RunPlan:
    """Explain and predict a run; integrates for about half a second and writes nothing.

    Args:
        experiment, changes, loads: as for ``rigidsim.run``.
        out: folder of the run folders, whose disk is checked for room.
        pilot_seconds: largest CPU time of the pilot, s; some thousands of steps give the mean.

    Returns:
        States, reasons, invariants, steps, seconds, bytes, warnings; ``as_dict`` for JSON.

    Raises:
        ConfigError: the config can't be run.
    """
    experiment = as_experiment(experiment, changes)
    began = time.process_time()
    level = choose_level(experiment, loads=loads)
    choosing = time.process_time() - began
    levels = compared_levels(experiment, level, loads)
    experiment, choice = chosen(level.experiment if level else experiment, loads=loads)
    began = time.process_time()
    prepared = prepare(experiment, loads=loads)
    preparing = time.process_time() - began
    refuse_taken_names(prepared)
    closed, why_not = closed_form_if_any(prepared.scene, driven=bool(loads))
    started, began = time.perf_counter(), time.process_time()
    parts = assemble(prepared)
    compile_seconds, building = time.perf_counter() - started, preparing + time.process_time() - began
    corrected = parts.steps()
    pilot = timed_pilot(prepared, corrected, pilot_seconds)
    step = math.ldexp(pilot.step, prepared.system.scaling.time)
    duration = abs(float(prepared.scene.samples.last - prepared.scene.start))
    steps = max(1.0, duration / step)
    samples = prepared.clock.count
    room = storage(prepared, Path(out) / prepared.scene.name)
    seconds_per_sample = _seconds_per_sample(prepared, parts, room.row)
    integrate = steps * pilot.seconds_per_step
    modelling = _modelling_seconds(prepared, levels)
    record = samples * seconds_per_sample
    system, unused = prepared.system, unused_variables(prepared, int(steps))
    rate = float(system.rate_bound)
    growth = growth_of(prepared, pilot.step, corrected)
    amplification = growth.amplified(duration)
    first = LATE if prepared.holds_late else 0
    held = prepared.holds_invariants and closed is not None and steps > first
    shared, equations = equation_texts(system.equations, **prepared.precision.options)
    warnings = [(str(caution.code), caution.text) for caution in cautions_of(prepared.scene)]
    if room.problem is not None:
        warnings.append(("disk_space", f"the run {room.problem}"))
    error: float | None = stable_law(prepared.law_tolerance, int(steps), rate, duration) * amplification
    if held:
        error = held_error(prepared, int(steps), rate, duration, amplification)
    if not system.requirements.attitude or prepared.algorithm.own_errors:
        error = None
    return RunPlan(
        name=prepared.scene.name,
        formulation=system.formulation.name,
        euler_sequence=system.sequence if system.angle_states else None,
        euler_partner_sequence=None if system.partner is None else system.partner.sequence,
        states=list(system.states),
        state_count=len(system.states),
        reasons=[StatesWhy(states=states, why=why) for states, why in system.reasons],
        left_out=[LeftOut(what=what, why=why) for what, why in system.left_out],
        switching=[PlannedSurface(surface=s.text, where=s.where) for s in system.plan.surfaces.found],
        turning=list(system.plan.surfaces.turning),
        shared_terms=shared,
        equations=equations,
        internal_units={
            "time_s": math.ldexp(1.0, system.scaling.time),
            "inertia_kg_m2": math.ldexp(1.0, system.scaling.inertia),
        },
        recorded=[v.name for v in dataset_variables(prepared) if v.name not in unused],
        invariants=[
            PlannedInvariant(name=i.name, why=i.why, numerical=i.numerical) for i in system.invariants
        ],
        precision=prepared.precision.name,
        tolerance=prepared.effective_tolerance,
        method=prepared.scene.config.integrator.method,
        closed_form=None if closed is None else closed.title,
        closed_form_why_not=why_not or None,
        hold_invariants=prepared.holds_invariants,
        hold_from_step=LATE if prepared.holds_late else None,
        levels=levels,
        accuracy=None
        if choice is None
        else PlannedSetting(chosen=choice.setting.title, why=choice.why, forecast=choice.forecast),
        taylor_order=parts.order,
        pilot=PilotCosts(
            steps=pilot.taken,
            step=step,
            seconds_per_step=pilot.seconds_per_step,
            seconds_per_sample=seconds_per_sample,
        ),
        predicted=Predicted(
            steps=steps,
            pace=None if torques_change_pace(prepared, pilot) else 1.0,
            integration_seconds=integrate,
            recording_seconds=record,
            building_seconds=building,
            choosing_seconds=choosing,
            modelling_seconds=modelling,
            total_seconds=compile_seconds + integrate + record + modelling,
            memory_bytes=_BASE_MEMORY + 3 * min(room.segments, SegmentLimits().bytes),
            segment_bytes=room.segments,
            dataset_bytes=room.dataset,
            timeline_bytes=room.timeline,
            free_bytes=room.free,
            attitude_error_rad=error,
            held=held,
            amplification=amplification,
            growth_seconds=growth.seconds,
        ),
        warnings=tuple(text for _, text in warnings),
        warning_codes=tuple(code for code, _ in warnings),
        **understood(prepared),
    )


def _modelling_seconds(prepared: InitialValueProblem, levels: Sequence[LevelCost]) -> float:
    """CPU time, s, of the full model next to an averaged run, as it was measured over the beginning."""
    average = prepared.system.formulation.average
    if average is None or not prepared.scene.config.output.estimate:
        return 0.0
    return next((row.modelling_seconds or 0.0 for row in levels if row.level == average.level), 0.0)


def _seconds_per_sample(prepared: InitialValueProblem, parts: Assembly, row: float) -> float:
    """Cost of a sample that takes ``row`` bytes, s."""
    count = _EVALUATED[prepared.precision.cheap]
    states = np.repeat(prepared.precision.array(prepared.system.initial)[None, :], count, axis=0)
    times = np.repeat(prepared.clock.internal(0, 1), count)
    block = SampleBlock.of(0, times, states, parts.wrapping.angles)
    started = time.perf_counter()
    parts.evaluator.evaluate(parts.evaluator.angles.apart(block))
    evaluation = (time.perf_counter() - started) / count
    return evaluation + row * _COMPRESSION + _BUFFERING
