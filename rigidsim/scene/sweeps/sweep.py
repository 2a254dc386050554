"""A sweep: the members of ``[sweep]``, each a single experiment identified by its exact values."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace as exchanged
from typing import Self

from rigidsim.errors import ConfigError, MemberError, Problem, Remedy
from rigidsim.scene.choices import AUTO, FULL
from rigidsim.scene.config import Experiment, validated
from rigidsim.scene.paths import Path
from rigidsim.scene.schema import config_model
from rigidsim.scene.sweep_table import INDICATORS, SweepTable
from rigidsim.scene.sweeps.axes import Axis, axis_name, clashes, refuse_unsettable
from rigidsim.scene.sweeps.values import axis_values
from rigidsim.scene.toml_text import apply_overrides, parse_toml

MOST_MEMBERS = 100_000_000
FITS = "fit"
"""What is kept of a sweep whose members are fits."""
_ASKED = Remedy("is asked for with rigidsim run --sweep KEY=SPEC", "changes={'sweep': {...}} adds one")
_SAME_FOR_ALL = {
    "name": "the sweep has one name",
    "description": "the sweep has one description",
    "sweep": "a sweep can't change itself",
    "output": "all members record the same",
}


@dataclass(frozen=True)
class Sweep:
    """All members of an experiment with a ``[sweep]``."""

    experiment: Experiment  # as it was given, with its ``[sweep]``
    base: Experiment  # the single experiment that the members vary
    axes: tuple[Axis, ...]  # in the order of the config; the last varies fastest in a product
    added: str = ""  # name of what members record only for indicators, if anything

    @classmethod
    def of(cls, experiment: Experiment) -> Self:
        """The sweep of a config.

        Raises:
            ConfigError: there is no sweep, or one without members; every problem found. Whether members can
                be run is told by ``experiment(member)``.
        """
        table = experiment.config.sweep
        if table is None:
            what = f"missing; a sweep has one, or {_ASKED}"
            raise ConfigError(Problem("[sweep]", what), experiment.source)
        problems: list[Problem] = []
        axes = []
        for key, given in table.axes.items():
            where = f'[sweep] axes."{key[:60]}"'
            try:
                path, plain = Path.of(key), ".".join(part.strip() for part in key.split("."))
                if path.steps[0] in _SAME_FOR_ALL:
                    raise ValueError(f"can't be swept: {_SAME_FOR_ALL[str(path.steps[0])]}")
                tables = parse_toml(experiment.text, experiment.source)
                taken = path.taken(config_model(), tables)
                refuse_unsettable(path, tables)
                values = axis_values(given, plain, table.seed, taken.length, taken.unit)
                axes.append(Axis(plain, axis_name(plain, given.name), taken.unit, values))
            except ValueError as error:
                problems.append(Problem(where, str(error)))
        events = [event.name for event in experiment.config.events]
        problems += clashes(axes, events, product=table.mode == "product")
        if experiment.config.fit is not None:
            problems += _of_fits(table)
        if experiment.config.output.sensitivity:
            what = "given with [sweep], which keeps none; leave it out, or run its members by themselves"
            problems.append(Problem("[output] sensitivity", what))
        if not problems:
            problems += _counts(table, axes)
        if problems:
            raise ConfigError(problems, experiment.source)
        return cls(experiment, _without_sweep(experiment), tuple(axes))

    @property
    def table(self) -> SweepTable:
        """``[sweep]`` as it stands in the config; of fits it keeps these."""
        table = self.experiment.config.sweep
        assert table is not None
        return table.model_copy(update={"keep": [FITS]}) if self.fits else table

    @property
    def fits(self) -> bool:
        """Whether each member is a fit, by the config's ``[fit]``, rather than a run."""
        return self.base.config.fit is not None

    @property
    def product(self) -> bool:
        """Whether the members are all combinations of the axes' values."""
        return self.table.mode == "product"

    @property
    def shape(self) -> tuple[int, ...]:
        """Members along each dimension: one for each axis of a product, a single one otherwise."""
        sizes = tuple(axis.values.count for axis in self.axes)
        return sizes if self.product else sizes[:1]

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions."""
        return tuple(axis.name for axis in self.axes) if self.product else ("member",)

    @property
    def count(self) -> int:
        """Number of members."""
        return math.prod(self.shape)

    def indices(self, member: int) -> tuple[int, ...]:
        """Index of each axis's value for a member; the last axis varies fastest."""
        if not self.product:
            return (member,) * len(self.axes)
        found = []
        for size in reversed(self.shape):
            member, index = divmod(member, size)
            found.append(index)
        return tuple(reversed(found))

    def texts(self, member: int) -> tuple[str, ...]:
        """The values that identify a member, as written in a config, in the order of the axes."""
        return tuple(axis.values.text(i) for axis, i in zip(self.axes, self.indices(member), strict=True))

    def told(self, member: int) -> str:
        """The values that identify a member, for people: to six digits, with units."""
        found = []
        for axis, index in zip(self.axes, self.indices(member), strict=True):
            text = axis.values.text(index)
            if axis.numeric:
                numbers = [f"{float(x):.6g}" for x in axis.exact(index)]
                text = f"[{', '.join(numbers)}]" if axis.values.components else numbers[0]
            unit = f" {axis.unit}" if axis.numeric and axis.unit != "1" else ""
            found.append(f"{axis.name} = {text}{unit}")
        return ", ".join(found)

    def overrides(self, member: int) -> list[str]:
        """``KEY=VALUE`` texts that turn the base experiment into the member."""
        return [f"{axis.key}={text}" for axis, text in zip(self.axes, self.texts(member), strict=True)]

    def experiment_of(self, member: int) -> Experiment:
        """The member as a single experiment; ConfigError names a member that a key doesn't take."""
        try:
            return self.base.having(self.overrides(member))
        except ConfigError as error:
            raise self.blamed(member, error) from None

    def worked_out(self, member: int) -> Experiment:
        """Like ``experiment_of`` in a tenth of the time, without the member's own text: for checks. A level
        of model that its run chooses by the accuracy asked for is the full one here.

        Raises:
            ConfigError: as for ``experiment_of``.
        """
        try:
            table = parse_toml(self.base.text, self.base.source)
            apply_overrides(table, self.overrides(member))
            config = validated(table, self.base.source)
        except ConfigError as error:
            raise self.blamed(member, error) from None
        if config.model.level == AUTO and config.integrator.accuracy_axis is not None:
            config = config.model_copy(update={"model": config.model.model_copy(update={"level": FULL})})
        return exchanged(self.base, config=config)

    def blamed(self, member: int, error: ConfigError) -> MemberError:
        """The error with the member named besides the key, unless it names the member already."""
        if isinstance(error, MemberError):
            return error
        texts = (text if len(text) <= 40 else text[:37] + "..." for text in self.texts(member))
        named = ", ".join(f"{axis.name} = {text}" for axis, text in zip(self.axes, texts, strict=True))
        problems = [
            Problem(f"[sweep] member {member} ({named})", self._reason(problem)) for problem in error.problems
        ]
        return MemberError(problems, self.experiment.source)

    def _reason(self, problem: Problem) -> str:
        """What is wrong with a member; of what is recorded only for indicators, the indicators are told."""
        added = f'given "{self.added}": '
        if not self.added or not problem.what.startswith(added):
            return f"{problem.where}: {problem.what}"
        names = ", ".join(f'"{name}"' for name in self.table.keep if name in INDICATORS)
        return f"[sweep] keep: given {names}: {problem.what.removeprefix(added)}"


def _of_fits(table: SweepTable) -> list[Problem]:
    """What a sweep of fits can't have."""
    problems = []
    if "keep" in table.model_fields_set:
        what = "given with [fit]: each member is a fit, and what it finds is kept; leave keep out"
        problems.append(Problem("[sweep] keep", what))
    for key in table.axes:
        if re.fullmatch(r"\s*fit\s*(\.\s*parameters\b.*)?", key):
            what = "can't be swept: all members estimate the same parameters"
            problems.append(Problem(f'[sweep] axes."{key[:60]}"', what))
    return problems


def _counts(table: SweepTable, axes: Sequence[Axis]) -> list[Problem]:
    """Axes of incompatible lengths, or with too many members."""
    sizes = [axis.values.count for axis in axes]
    if table.mode == "zip":
        if len(set(sizes)) > 1:
            given = ", ".join(f'"{axis.key}" {axis.values.count}' for axis in axes)
            what = f'given "zip", which needs axes of one length: {given}; or choose mode = "product"'
            return [Problem("[sweep] mode", what)]
        taken = 'the name "member" is taken; give that axis another'
        return [Problem("[sweep] axes", taken)] if "member" in {axis.name for axis in axes} else []
    count = math.prod(sizes)
    if count > MOST_MEMBERS:
        given = " x ".join(f"{size:,}" for size in sizes)
        about = f"{count:.3g}".replace("e+", "e")
        what = f"ask for {given} = {about} members; at most 1e8 are allowed: take fewer values"
        return [Problem("[sweep] axes", what)]
    return []


def _without_sweep(experiment: Experiment) -> Experiment:
    """The config without its ``[sweep]``, everything else as written."""
    base = experiment.having(["sweep="])
    if base.config.integrator.hold_invariants == "auto":  # which members of a sweep haven't
        base = base.having(["integrator.hold_invariants=false"])
    return base
