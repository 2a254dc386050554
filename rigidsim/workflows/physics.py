"""``plan --physics ERROR``: run the full model and those without an effect, and name the least one found.

Effects are each load and rotor, what ``[body]`` brings, and parts of these, which loads list themselves
(``SceneLoad.effect_parts``).
"""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.accuracy.choice import chosen
from rigidsim.accuracy.comparison import parts_of, rotation_vectors
from rigidsim.accuracy.modelling import Unmeasured, measure_modelling
from rigidsim.errors import FORCE, OUT, ConfigError, Problem, Remedy, RunFolderError
from rigidsim.model.load import loads_of
from rigidsim.scene.choices import FULL, REDUCED
from rigidsim.scene.config import Experiment, assignments_of
from rigidsim.scene.exact import parse_number
from rigidsim.scene.readable import span_text
from rigidsim.scene.registry import LOADS, EffectPart, names_of, one_of
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.swept import plain
from rigidsim.session.session import Tuning
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.store.folder import RunFolder
from rigidsim.store.outputs import refuse_inputs, refuse_loss, writing
from rigidsim.store.run import SavedRun
from rigidsim.store.summary import Summary, SummaryPart
from rigidsim.workflows.read import Given, as_experiment
from rigidsim.workflows.run import resume, run

_TITLES = {
    "loads": "", "rotors": "rotor ", "rigid_bodies": "rigid body ",
    "bodies": "attraction by the point mass ",
}  # fmt: skip
"""What tables of arrays are called before their names."""


@dataclass(frozen=True)
class PhysicalEffect:
    """Something that acts in a scene, and can be left out.

    Attributes:
        code: its name, short and without spaces.
        words: what it is.
        values: new values by dotted key; None removes a key.
        gone: array of tables and place of the one that is removed; None for none.
        parts_of: codes of wider effects, without which this one isn't there either.
        missing: why a scene has none of it, if so.
    """

    code: str
    words: str
    values: Mapping[str, Any] = field(default_factory=dict)
    gone: tuple[str, int] | None = None
    parts_of: tuple[str, ...] = ()
    missing: str = ""


def load_codes(config: Config) -> list[str]:
    """A code for each load: its name, or its source's, or its kind; numbered if others share it."""
    plain = [(names_of(x) or [x.kind])[0] for x in config.loads]  # type: ignore[attr-defined]
    shared = Counter(plain)
    return [name if shared[name] == 1 else f"{name}-{n}" for n, name in enumerate(plain, 1)]


def effects_of(config: Config) -> dict[str, PhysicalEffect]:
    """All effects of a config by code, wider ones after their parts."""
    return {effect.code: effect for effect in _all(config) if not effect.missing}


def missing_from(config: Config) -> list[tuple[str, str]]:
    """What a config has no constants for, and why it is missing; the same of several loads in one row."""
    rows: dict[tuple[str, str], list[str]] = {}
    for effect in _all(config):
        if effect.missing:
            rows.setdefault((effect.words, effect.missing), []).extend(effect.parts_of[:1])
    loads = set(load_codes(config))
    named = {row: ", ".join(code for code in codes if code in loads) for row, codes in rows.items()}
    return [(f"{words} ({of})" if of else words, why) for (words, why), of in named.items()]


def _all(config: Config) -> Iterator[PhysicalEffect]:
    codes = load_codes(config)
    for n, (code, fields) in enumerate(zip(codes, config.loads, strict=True)):
        parts = [*LOADS["kind"][fields.kind].effect_parts(fields)]  # type: ignore[attr-defined]
        for key, kind in LOADS["beside"].items():
            parts += kind.effect_parts(fields) if key in type(fields).model_fields else []
        yield from _parts(code, f"loads[{n}]", parts)
        yield PhysicalEffect(code, fields.kind.replace("_", " "), gone=("loads", n))  # type: ignore[attr-defined]
    for key, load in LOADS["body"].items():
        if not load.brought_by(config) or _is_nothing(config, key, load.nothing):
            yield PhysicalEffect(key, load.title, missing=f"the config gives none ([body] {key})")
            continue
        yield from _parts(key, f"body.{key}", load.effect_parts(config))
        if load.nothing:
            preset = config.body.preset is not None
            given = {f"{key}.{x}": value for x, value in load.nothing.items()} if preset else {key: None}
            yield PhysicalEffect(key, load.title, {f"body.{x}": value for x, value in given.items()})
        else:
            yield PhysicalEffect(key, load.title, missing="no single key leaves it out")
    for array in ("bodies", *LOADS["table"]):
        for n, table in enumerate(getattr(config, array)):
            words = f"{_TITLES.get(array, '')}{table.name}"
            yield PhysicalEffect(f"{one_of(array)}-{table.name}", words, gone=(array, n))
        if array in LOADS["table"] and not getattr(config, array):
            yield PhysicalEffect(array, array, missing=f"the config has no [[{array}]]")
    if {fields.kind for fields in config.loads} < set(LOADS["kind"]):  # type: ignore[attr-defined]
        yield PhysicalEffect("others", "loads of other kinds", missing="none is given")


def _parts(
    code: str, table: str, parts: Sequence[EffectPart] | Iterator[EffectPart]
) -> Iterator[PhysicalEffect]:
    for part in parts:
        yield PhysicalEffect(
            f"{code}-{part.name}",
            part.words,
            {f"{table}.{key}": value for key, value in part.without.items()},
            parts_of=(code, *(f"{code}-{name}" for name in part.wider)),
            missing=part.missing,
        )


def _is_nothing(config: Config, key: str, nothing: Mapping[str, Any]) -> bool:
    return bool(nothing) and all(getattr(getattr(config.body, key), x).sign == 0 for x in nothing)


def outermost(effects: Mapping[str, PhysicalEffect], codes: Collection[str]) -> list[str]:
    """The codes without those that are parts of others among them, in the order of the effects."""
    return [c for c in effects if c in codes and not set(effects[c].parts_of) & set(codes)]


def settings_without(experiment: Experiment, codes: Sequence[str]) -> list[str]:
    """The changes, as ``KEY=VALUE``, to a config that leave out some of its effects: values first, then what
    is removed, so that places stay true.
    """
    config, known = experiment.config, effects_of(experiment.config)
    left_out = [known[code] for code in outermost(known, codes)]
    values = {key: value for effect in left_out for key, value in effect.values.items()}
    gone = sorted(effect.gone for effect in left_out if effect.gone)
    names = {name for array, n in gone if array == "loads" for name in names_of(config.loads[n])}
    for key, kind in LOADS["body"].items():
        if kind.brought_by(config) and key not in codes:
            values = {f"body.{key}.{x}": y for x, y in kind.without_loads(config, names).items()} | values
    counts = Counter(array for array, _ in gone)
    removed = dict.fromkeys(
        array if counts[array] == len(getattr(config, array)) else f"{array}[{n}]"
        for array, n in reversed(gone)
    )
    return [*assignments_of(values), *(f"{key}=" for key in removed)]


def without(experiment: Experiment, codes: Sequence[str]) -> Experiment:
    """The experiment without some of its effects."""
    settings = settings_without(experiment, codes)
    return experiment.with_overrides(settings) if settings else experiment


# --- what effects are worth ---------------------------------------------------------------------------------

Report = Callable[[str], None]
ARCSEC = math.degrees(1.0) * 3600.0
"""Arcseconds of a radian."""
FIGURE = "ladder.png"
_LONGEST, _LEAST = 80, 94  # letters of a run's name, and of one that becomes the least model's
_UNCERTAIN = 0.1  # of the error, up to which rounding doesn't matter
_LIGHT = 299792458.0  # m/s
_ACCURACY = {f"integrator.{key}" for key in ("accuracy", "accuracy_axis", "accuracy_position")}
_BESIDE = {f"output.{key}" for key in ("lyapunov", "sensitivity", "tip")}
_FOR_FULL = {f"integrator.{key}" for key in ("accuracy", "method", "formulation", "hold_invariants")}
"""Keys that an average may refuse, and that don't matter for what it errs by."""


class MeasuredModel(SummaryPart):
    """A model that was run.

    Attributes:
        rms_arcsec, largest_arcsec: angle between its attitudes and the full model's; of averages between the
            axes.
        operations: of its equations. cpu_seconds, steps: of its run, in the folder ``run``.
    """

    rms_arcsec: float
    largest_arcsec: float
    operations: int
    steps: int
    cpu_seconds: float
    run: str


class EffectWorth(MeasuredModel):
    """What leaving out one effect does, over the span; ``required``: whether the least model has it."""

    code: str
    words: str
    required: bool


class UnassessedEffect(SummaryPart):
    """An effect that wasn't assessed, and why."""

    what: str
    why: str


class AveragedLevel(SummaryPart):
    """A ``[model] level`` that averages, and the largest angle between its axes and the full model's."""

    level: str
    largest_arcsec: float


class ComparedModel(MeasuredModel):
    """A model that was run, against the full one.

    Attributes:
        left_out: codes of the effects that it doesn't have; of those with parts the whole alone.
        expected_arcsec: largest angle of the sum of what its effects do one by one.
        cost: steps times operations; of a closed form, which has no steps, the operations.
        within: whether its largest angle is within the error.
    """

    left_out: list[str]
    expected_arcsec: float
    cost: int
    within: bool


class PhysicsPlan(SummaryPart):
    """What each effect of a scene is worth, and the least model found within an error.

    Attributes:
        error_arcsec: the error asked for.
        effects: the most worth first.
        compared: the variable that angles are of: quaternion, or the axis of an average.
        tried: the models that were run in search of the least one, which is the last.
        uncertainty_arcsec: of the full model's attitude at the end by rounding; None if not estimated.
        written: file of the least model's config; None if none was asked for.
    """

    name: str
    error_arcsec: float
    compared: str
    span_s: float
    samples: int
    full: ComparedModel
    least: ComparedModel
    effects: list[EffectWorth]
    averaged: list[AveragedLevel]
    not_assessed: list[UnassessedEffect]
    tried: list[ComparedModel]
    uncertainty_arcsec: float | None
    warnings: list[str]
    folder: str
    figure: str
    written: str | None

    def __repr__(self) -> str:
        least = self.least
        left_out = ", ".join(least.left_out) or "nothing"
        rows = [f"  {x.code:24} {x.largest_arcsec:11.4g} arcsec" for x in self.effects]
        first = f"<Physics of {self.name!r} within {self.error_arcsec:.4g} arcsec: leave out {left_out}, "
        return "\n".join([f"{first}{least.largest_arcsec:.4g} arcsec", *rows]) + ">"


def required_physics(
    experiment: Given,
    error: str | float | Decimal,
    *,
    out: str | Path = "runs",
    write: str | Path | None = None,
    force: bool = False,
    told: Report = lambda _: None,
    tuning: Tuning | None = None,
) -> PhysicsPlan:
    """Measure the size of each effect of a scene, and find a least model within an error.

    Args:
        experiment: as for ``rigidsim.run``.
        error: largest angle between the attitudes, such as ``"0.1 arcsec"``; a number is in rad.
        out: the runs are kept in ``out/NAME-physics``; another call continues them.
        write: file for the least model's config.
        force: replace runs of another config, and the file.
        told: receives a line before each run.
        tuning: as for ``rigidsim.run``.

    Raises:
        ConfigError: the config can't be run, nothing can be left out of it, or a bad error.
        RunFolderError: a run didn't end, or a folder holds other runs.
    """
    experiment = as_experiment(experiment)
    most, config = _asked(error), experiment.config
    folder = Path(out) / f"{config.name}-physics"
    refuse_inputs([folder], experiment.files)
    if write is not None:
        refuse_loss([Path(write)], experiment.files, force=force)
    scene, effects = prepare(experiment).scene, effects_of(config)
    if not effects:
        what = "has neither loads nor rotors, elasticity or a core, so that nothing can be left out: the "
        what += "body rotates freely; plan without --physics shows what is integrated"
        raise ConfigError(Problem("config", what), experiment.source)
    absent = missing_from(config)
    models = _Models(experiment, folder, force, tuning, told)
    full, alone = models.run([]), dict[str, _ModelRun]()
    for code, effect in effects.items():
        try:
            alone[code] = models.run([code])
        except ConfigError as problem:
            # without the names that are allowed: tables are numbered as in the smaller config
            reasons = "; ".join(one.what.partition("; allowed: ")[0] for one in problem.problems)
            absent.append((f"{effect.words} ({code})", f"can't be left out by itself: {reasons}"))
    if not alone:
        raise ConfigError(Problem("config", "no effect can be left out by itself; nothing to compare"))
    averaged, why_not = _averaged_levels(experiment)
    absent += [*why_not, *_geodetic(scene)]
    tried = _tried(models, alone, most)
    least, doubt = tried[-1], None if full.uncertainty is None else full.uncertainty * ARCSEC
    rows = [
        EffectWorth(
            code=code,
            words=effects[code].words,
            required=not {code, *effects[code].parts_of} & {*least.left_out},
            **done.measured,
        )
        for code, done in alone.items()
    ]
    warnings = []
    if doubt is not None and doubt > _UNCERTAIN * most:
        what = f"the full model's attitude is uncertain by {doubt:.1e} arcsec itself, by rounding: ask for a "
        warnings.append(what + "larger error, or for more precision")
    result = PhysicsPlan(
        name=config.name,
        error_arcsec=most,
        compared=models.compared,
        span_s=abs(float(scene.samples.last - scene.start)),
        samples=len(full.rotations),
        full=full.compared([], 0.0, most),
        least=least,
        effects=sorted(rows, key=lambda row: -row.largest_arcsec),
        averaged=averaged,
        not_assessed=[UnassessedEffect(what=what, why=why) for what, why in absent],
        tried=tried,
        uncertainty_arcsec=doubt,
        warnings=warnings,
        folder=str(folder),
        figure=str(folder / FIGURE),
        written=None if write is None else str(write),
    )
    if write is not None:
        made = _recorded(without(experiment, least.left_out))
        made = made.with_overrides([f'name="{config.name[:_LEAST]}-least"'])  # next to the full one's run
        with writing(Path(write)) as new:
            new.write_text(_comments(result) + made.text, encoding="utf-8")
    from rigidsim.look.figures.ladder import ladder_figure  # which loads matplotlib

    with writing(folder / FIGURE) as temporary:
        ladder_figure(result.as_dict()).savefig(temporary, format="png")
    return result


def _asked(error: str | float | Decimal) -> float:
    """The error, arcsec."""
    try:
        value = float(parse_number(error, "rad"))
    except ValueError:
        value = math.nan
    if not 0 < value < math.pi:
        what = f'given {error}; an angle such as "0.1 arcsec" is allowed, above 0 and below half a turn'
        raise ConfigError(Problem(str(Remedy("--physics", "error")), what))
    return value * ARCSEC


# --- models as runs -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _ModelRun:
    """A model that was run.

    Attributes:
        rotations: rotation vectors (n, 3), arcsec, from the full model's attitudes to its own.
        uncertainty: of the model's attitude at the end by rounding, rad; None if not estimated.
        measured: the fields of a ``MeasuredModel``.
    """

    rotations: np.ndarray
    uncertainty: float | None
    measured: dict[str, Any]

    @property
    def largest(self) -> float:
        """Largest angle from the full model, arcsec."""
        return float(self.measured["largest_arcsec"])

    def compared(self, codes: Sequence[str], expected: float, most: float) -> ComparedModel:
        cost = max(self.measured["steps"], 1) * self.measured["operations"]
        return ComparedModel(
            left_out=[*codes], expected_arcsec=expected, cost=cost, within=self.largest <= most,
            **self.measured,
        )  # fmt: skip


class _Models:
    """The full model of an experiment and those without some of its effects, as runs in one folder, each of
    which is found there, gone on with, or begun.

    Attributes:
        compared: the variable that is compared: the attitude, or the axis of an average, which keeps none.
    """

    def __init__(
        self, given: Experiment, folder: Path, force: bool, tuning: Tuning | None, report: Report
    ) -> None:
        self.effects, self.compared = effects_of(given.config), "quaternion"
        self._folder, self._force, self._tuning, self._report = folder, force, tuning, report
        self._done: dict[tuple[str, ...], _ModelRun] = {}
        self._attitudes: list[np.ndarray] = []  # of the full model
        if given.config.model.level in REDUCED:
            self.compared = "figure_axis" if _recordable(given, "figure_axis") else "momentum_axis"
        settings = _removed(given, _ACCURACY | _BESIDE)
        settings += [f'output.record=["{self.compared}"]', "output.timeline=false"]
        self._full = chosen(given)[0].with_overrides(settings)

    def run(self, codes: Collection[str]) -> _ModelRun:
        """The run without some effects.

        Raises:
            ConfigError: there is no such config. RunFolderError: the run didn't end, or another is there.
        """
        left_out = tuple(outermost(self.effects, codes))
        if left_out not in self._done:
            self._done[left_out] = self._run(left_out)
        return self._done[left_out]

    def _run(self, codes: tuple[str, ...]) -> _ModelRun:
        name = "-".join(["without", *codes]) if codes else "full"
        if len(name) > _LONGEST:
            name = f"{name[: _LONGEST - 9]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
        estimate = str(not codes).lower()
        model = without(self._full, codes).with_overrides([f'name="{name}"', f"output.estimate={estimate}"])
        done = self._saved(model)
        summary = done.outcome
        if not isinstance(summary, Summary) or summary.status != "finished":
            raise RunFolderError(
                f"{done.place}: ended as {done.status} ({summary.message or ''}), and models are compared "
                "over the whole span; give it the time or steps that it needs, and call this again"
            )
        with done.dataset as dataset:
            attitudes = parts_of(dataset, self.compared, np.arange(dataset.sizes["time"]))
        self._attitudes = self._attitudes or attitudes
        rotations = rotation_vectors(self._attitudes, attitudes) * ARCSEC
        angles = np.linalg.norm(rotations, axis=1)
        measured = {
            "rms_arcsec": float(np.sqrt(np.mean(angles**2))),
            "largest_arcsec": float(angles.max()),
            "operations": size_of(prepare(model)),
            "steps": summary.cost.steps,
            "cpu_seconds": summary.cost.cpu_seconds,
            "run": str(self._folder / name),
        }
        return _ModelRun(rotations, summary.accuracy.estimated_attitude_error, measured)

    def _saved(self, model: Experiment) -> SavedRun:
        """The run of a model, whatever of it there is already."""
        folder = RunFolder(self._folder / model.config.name)
        begun = folder.config.exists() and (folder.dataset.exists() or folder.segments.exists())
        if begun and folder.config.read_text(encoding="utf-8") == model.text:
            if not folder.dataset.exists():
                self._report(f"{model.config.name}: continues")
            return resume(folder.path, tuning=self._tuning, progress=False)
        if begun and not self._force:
            raise RunFolderError(
                f"{folder.path}: holds the run of another config; {FORCE} replaces it, another {OUT} puts "
                "these runs elsewhere"
            )
        self._report(f"{model.config.name}: begun")
        return run(model, out=self._folder, force=begun, tuning=self._tuning, progress=False)


def size_of(prepared: InitialValueProblem) -> int:
    """Operations of the compiled equations, each part counted once."""
    equations = prepared.system.equations
    function = hy.cfunc(
        [right for _, right in equations],
        [variable for variable, _ in equations],
        compact_mode=True,
        **prepared.precision.options,
    )
    return len(function.dc) - 2 * len(equations)


def _removed(experiment: Experiment, keys: Collection[str]) -> list[str]:
    """Settings that remove the keys as far as a config gives them."""
    given = {
        f"{table}.{key}"
        for table in ("output", "integrator")
        for key in getattr(experiment.config, table).model_fields_set
    }
    return [f"{key}=" for key in sorted(given.intersection(keys))]


def _recordable(experiment: Experiment, name: str) -> bool:
    try:
        prepare(experiment.with_overrides([f'output.record=["{name}"]']))
    except ConfigError:
        return False
    return True


# --- the least model ----------------------------------------------------------------------------------------


def _tried(models: _Models, alone: dict[str, _ModelRun], most: float) -> list[ComparedModel]:
    """Models that were run in search of the least one, which is the last.

    Effects are left out from the least worth on, as long as the sum of what they do, as rotation vectors at
    every sample, is within the error (arcsec). The model is run; while it is beyond the error, its effect
    worth most is put back.
    """

    def summed(codes: Sequence[str]) -> float:
        total = sum((alone[code].rotations for code in codes), np.zeros((1, 3)))
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
            tried.append(models.run(left_out).compared(left_out, summed(left_out), most))
        worst = max(left_out, key=lambda code: alone[code].largest, default="")
        left_out = [code for code in left_out if code != worst]
    return tried


def _recorded(experiment: Experiment) -> Experiment:
    """The experiment without asking to record what it doesn't have."""
    names = experiment.config.output.record or []
    kept = [name for name in names if _recordable(experiment, name)]
    return (
        experiment
        if kept == names
        else experiment.with_overrides([f"output.record={kept}".replace("'", '"')])
    )


def _comments(plan: PhysicsPlan) -> str:
    """What the least model leaves out, for the head of its config."""
    rows = [row for row in plan.effects if not row.required]
    within = f"within {plan.error_arcsec:.4g} arcsec over {span_text(plan.span_s)}"
    lines = [
        f"The least model of {plan.name} {within} (rigidsim plan --physics): measured, it differs",
        f"from the full one by {plan.least.largest_arcsec:.4g} arcsec at most.",
        "Left out, with what each is worth by itself:" if rows else "Nothing is left out.",
        *(f"  {row.largest_arcsec:.4g} arcsec  {row.code}: {row.words}" for row in rows),
        "What follows is the full model's config without these: its comments speak of the full model.",
    ]
    return "".join(f"# {line}\n" for line in lines) + "#\n"


# --- what no config is without, or has ----------------------------------------------------------------------


def _averaged_levels(experiment: Experiment) -> tuple[list[AveragedLevel], list[tuple[str, str]]]:
    """Each averaged model of a config, and what it errs by in the direction of axes; or why there is none.

    It isn't among the models that are compared, since it keeps no attitude.
    """
    if experiment.config.model.level != FULL:
        return [], [("averaging", "the config's own model is an average, whose error runs measure")]
    found: list[AveragedLevel] = []
    absent: dict[str, list[str]] = {}
    plainer = _removed(experiment, {"output.record", *_FOR_FULL, *_BESIDE})
    for level in REDUCED:
        try:
            averaged = prepare(experiment.with_overrides([f'model.level="{level}"', *plainer]))
            worst = measure_modelling(averaged).worst
            found.append(AveragedLevel(level=level, largest_arcsec=worst * ARCSEC))
        except ConfigError as error:  # without what was given and what to choose: nobody chose it
            whats = [problem.what.partition("; choose")[0] for problem in error.problems]
            why = "; ".join(what.partition(", but ")[2] or what for what in whats)
            absent.setdefault(why, []).append(level)
        except Unmeasured as why_not:
            absent.setdefault(str(why_not), []).append(level)
    return found, [(f"averaging ({', '.join(levels)})", why) for why, levels in absent.items()]


def _geodetic(scene: Scene) -> list[tuple[str, str]]:
    """The geodetic precession, which the full model hasn't: its most, at the nearest place of the source by
    which it is largest, 3/2 (G M)^(3/2) / (c^2 r^(5/2)). Nothing without such a source.
    """
    rates = [0.0]
    for load in loads_of(scene):
        if source := load.gradient_source:
            distance = float(plain(source.placement.nearest(scene)))
            strength = float(plain(source.gravitational_parameter))
            rates.append(1.5 * strength**1.5 / (_LIGHT**2 * distance**2.5))
    size = max(rates) * abs(float(scene.samples.last - scene.start)) * ARCSEC
    why = f"the equations have none; a free axis would turn by at most {size:.2g} arcsec over the span, "
    return [("geodetic precession", why + "an axis locked to its orbit not at all")] if size else []
