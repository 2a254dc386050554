"""``plan --physics ERROR``: run the full model and those without an effect, and name the least one found."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem, Remedy
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import parse_number
from rigidsim.scene.readable import span_text
from rigidsim.session.session import Tuning
from rigidsim.solve.problem import prepare
from rigidsim.store.outputs import refuse_inputs, refuse_loss, writing
from rigidsim.workflows.physics.beyond import averaged_levels, geodetic
from rigidsim.workflows.physics.effects import missing_from, outermost, without
from rigidsim.workflows.physics.models import ModelRun, Models
from rigidsim.workflows.physics.table import (
    ARCSEC,
    ComparedModel,
    EffectWorth,
    PhysicsPlan,
    UnassessedEffect,
)
from rigidsim.workflows.read import Given, as_experiment

FIGURE = "ladder.png"
_LONGEST = 94  # of a name that becomes the least model's
_WHERE = Remedy("--physics", "error")
_UNCERTAIN = 0.1  # of the error, up to which rounding doesn't matter


def required_physics(
    experiment: Given,
    error: str | float | Decimal,
    *,
    out: str | Path = "runs",
    write: str | Path | None = None,
    force: bool = False,
    told: Callable[[str], None] = lambda _: None,
    tuning: Tuning | None = None,
) -> PhysicsPlan:
    """Measure what each effect of a scene is worth, and find a least model within an error.

    Args:
        experiment: as for ``rigidsim.run``.
        error: largest angle between the attitudes, such as ``"0.1 arcsec"``; a number is in rad.
        out: the runs are kept in ``out/NAME-physics``; called again, it goes on with them.
        write: file for the least model's config.
        force: replace runs of another config, and the file.
        told: is given a line before each run.
        tuning: as for ``rigidsim.run``.

    Raises:
        ConfigError: the config can't be run, nothing can be left out of it, or a bad error.
        RunFolderError: a run didn't end, or a folder holds other runs.
    """
    experiment = as_experiment(experiment)
    most = _asked(error)
    if not isinstance(out, str | Path):
        what = f"given {out!r}; a folder is allowed: the runs are kept there, so that they can go on"
        raise ConfigError(Problem("out", what))
    target = None if write is None else Path(write)
    folder = Path(out) / f"{experiment.config.name}-physics"
    refuse_inputs([folder], experiment.files)
    if target is not None:
        refuse_loss([target], experiment.files, force=force)
    prepared = prepare(experiment)
    models = Models(experiment, folder, force, tuning, told)
    if not models.effects:
        what = (
            "has neither loads nor rotors, elasticity or a core, so that nothing can be left out: the body "
        )
        what += "rotates freely; plan without --physics shows what is integrated"
        raise ConfigError(Problem("config", what), experiment.source)
    absent = [UnassessedEffect(what=what, why=why) for what, why in missing_from(experiment.config)]
    full = models.run([])
    alone: dict[str, ModelRun] = {}
    for code, effect in models.effects.items():
        try:
            alone[code] = models.run([code])
        except ConfigError as problem:
            # without the names that are allowed: numbers of tables are those of the smaller config
            reasons = "; ".join(one.what.partition("; allowed: ")[0] for one in problem.problems)
            why = f"can't be left out by itself: {reasons}"
            absent.append(UnassessedEffect(what=f"{effect.words} ({code})", why=why))
    if not alone:
        raise ConfigError(Problem("config", "no effect can be left out by itself; nothing to compare"))
    averaged, why_not = averaged_levels(experiment)
    beyond = geodetic(prepared.scene)
    tried = _tried(models, alone, most)
    least, config = tried[-1], experiment.config
    gone = {code for code in alone if {code, *models.effects[code].parts_of} & {*least.left_out}}
    effects = [
        EffectWorth(
            code=code, words=models.effects[code].words, required=code not in gone, **_measured(done)
        )
        for code, done in alone.items()
    ]  # fmt: skip
    result = PhysicsPlan(
        name=config.name,
        error_arcsec=most * ARCSEC,
        compared=models.compared,
        span_s=abs(float(prepared.scene.samples.last - prepared.scene.start)),
        samples=len(full.rotations),
        full=_compared(full, [], 0.0, most),
        least=least,
        effects=sorted(effects, key=lambda x: -x.largest_arcsec),
        averaged=averaged,
        not_assessed=[*absent, *why_not, *([beyond] if beyond else [])],
        tried=tried,
        uncertainty_arcsec=None if full.uncertainty is None else full.uncertainty * ARCSEC,
        warnings=_warnings(full, most),
        folder=str(folder),
        figure=str(folder / FIGURE),
        written=None if target is None else str(target),
    )
    if target is not None:
        made = least_config(experiment, least.left_out)
        made = made.having([f'name="{config.name[:_LONGEST]}-least"'])  # beside the full one's run
        with writing(target) as new:
            new.write_text(_comments(result) + made.text, encoding="utf-8")
    from rigidsim.look.figures.ladder import save_ladder  # which loads matplotlib

    with writing(folder / FIGURE) as temporary:
        save_ladder(result.as_dict(), temporary)
    return result


def _tried(models: Models, alone: Mapping[str, ModelRun], most: float) -> list[ComparedModel]:
    """Models that were run in search of the least one, which is the last.

    Effects are left out from the least worth on, as long as the sum of what they do, as rotation vectors at
    every sample, is within the error (rad). The model is run; while it is beyond the error, its effect worth
    most is put back.
    """

    def summed(codes: Sequence[str]) -> float:
        total = sum((alone[code].rotations for code in codes), np.zeros_like(models.run([]).rotations))
        return float(np.linalg.norm(total, axis=1).max())

    left_out: list[str] = []
    before = None
    while before != left_out:  # a later effect may make room for an earlier one
        before = left_out
        for code in sorted(alone, key=lambda code: alone[code].largest):
            more = outermost(models.effects, [*left_out, code])
            left_out = more if set(more) <= set(alone) and summed(more) <= most else left_out
    tried: list[ComparedModel] = []
    while not tried or not tried[-1].within:
        with suppress(ConfigError):  # a config that has no meaning without all of these
            tried.append(_compared(models.run(left_out), left_out, summed(left_out), most))
        worst = max(left_out, key=lambda code: alone[code].largest, default="")
        left_out = [code for code in left_out if code != worst]
    return tried


def least_config(experiment: Experiment, codes: Sequence[str]) -> Experiment:
    """The experiment without some effects, and without asking to record what isn't there then."""
    made = without(experiment, codes)
    names = made.config.output.record or []
    kept = [name for name in names if _recordable(made, name)]
    return made if kept == names else made.having([f"output.record={kept}".replace("'", '"')])


def _recordable(experiment: Experiment, name: str) -> bool:
    try:
        prepare(experiment.having([f'output.record=["{name}"]']))
    except ConfigError:
        return False
    return True


def _asked(error: str | float | Decimal) -> float:
    """The error, rad."""
    try:
        value = float(parse_number(error, "rad"))
    except ValueError as problem:
        what = f'{problem}; an angle such as "0.1 arcsec" is allowed'
        raise ConfigError(Problem(str(_WHERE), what)) from None
    if not 0 < value < math.pi:
        what = f'given {error}; an angle above 0 and below half a turn is allowed, such as "0.1 arcsec"'
        raise ConfigError(Problem(str(_WHERE), what))
    return value


def _measured(done: ModelRun) -> dict[str, Any]:
    return {
        "rms_arcsec": done.rms * ARCSEC,
        "largest_arcsec": done.largest * ARCSEC,
        "operations": done.operations,
        "steps": done.steps,
        "cpu_seconds": done.cpu_seconds,
        "run": str(done.folder),
    }


def _compared(done: ModelRun, codes: Sequence[str], expected: float, most: float) -> ComparedModel:
    return ComparedModel(
        left_out=list(codes), expected_arcsec=expected * ARCSEC, cost=done.cost, within=done.largest <= most,
        **_measured(done),
    )  # fmt: skip


def _comments(plan: PhysicsPlan) -> str:
    """What the least model leaves out, for the head of its config."""
    what = (
        f"The least model of {plan.name} within {plan.error_arcsec:.4g} arcsec over {span_text(plan.span_s)}"
    )
    lines = [f"{what} (rigidsim plan --physics): measured, it differs"]
    lines.append(f"from the full one by {plan.least.largest_arcsec:.4g} arcsec at most.")
    rows = [row for row in plan.effects if not row.required]
    lines.append("Left out, with what each is worth by itself:" if rows else "Nothing is left out.")
    lines += [f"  {row.largest_arcsec:.4g} arcsec  {row.code}: {row.words}" for row in rows]
    lines.append(
        "What follows is the full model's config without these: its comments speak of the full model."
    )
    return "".join(f"# {line}\n" for line in lines) + "#\n"


def _warnings(full: ModelRun, most: float) -> list[str]:
    if full.uncertainty is None or full.uncertainty <= _UNCERTAIN * most:
        return []
    what = f"the full model's attitude is uncertain by {full.uncertainty * ARCSEC:.1e} arcsec itself, by "
    return [what + "rounding: ask for a larger error, or for more precision"]
