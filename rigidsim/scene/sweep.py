"""A sweep: the members of ``[sweep]``, each a single experiment identified by its exact values.

Random values depend on seed, key, index and component alone: an axis that is prolonged keeps the values that
it had, and any process can draw any of them.
"""

import hashlib
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from statistics import NormalDist
from typing import Any, Self

import mpmath
import numpy as np

from rigidsim.errors import ConfigError, MemberError, Problem, Remedy, ensure
from rigidsim.scene.choices import AUTO, FULL
from rigidsim.scene.config import Experiment, inline, parse_toml
from rigidsim.scene.exact import ExactNumber, fraction_of, parse_number
from rigidsim.scene.paths import Path, leaves
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.schema import INDICATORS, LARGEST_AXIS, AxisTable, SweepTable, config_model
from rigidsim.scene.validation_messages import nearest, shown

MOST_MEMBERS = 100_000_000
FITS = "fit"
"""What is kept of a sweep whose members are fits."""
DIGITS = 40
"""Significant decimal digits of values that aren't rational: of logspace, and on a sphere."""
_ASKED = Remedy("is asked for with rigidsim run --sweep KEY=SPEC", "changes={'sweep': {...}} adds one")
_SAME_FOR_ALL = {
    "name": "the sweep has one name",
    "description": "the sweep has one description",
    "sweep": "a sweep can't change itself",
    "output": "all members record the same",
}
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,60}")
_OF_LINES = ("_frequency", "_amplitude", "_rate")
"""Suffixes of what is kept of signals' frequencies."""
_NO_EXPRESSIONS = {"name", "description", "sweep", "parameters"}

Numbers = tuple[ExactNumber, ...]
_Values = tuple[int, int, Callable[[int], Any]]
"""Keys of an axis: ``count``, ``components`` and ``value``."""


@dataclass(frozen=True)
class Axis:
    """One swept key. A value is the same number whatever else the axis holds, so that values identify a
    member.

    Attributes:
        key: dotted, with indices from 0.
        name: of its dimension (product) or variable (zip).
        unit: SI unit of its numbers; "1" for none.
        count: number of values.
        components: of each value; 0 for plain numbers, and for values that aren't numbers.
        value: by index, either the numbers of a value, or the TOML text of what is none.
    """

    key: str
    name: str
    unit: str
    count: int
    components: int
    value: Callable[[int], Any]

    @classmethod
    def of(cls, key: str, given: AxisTable, seed: int, experiment: Experiment) -> Self:
        """The axis of a table of ``[sweep] axes``; ValueError says what is wrong with it."""
        path, plain = Path.of(key), ".".join(part.strip() for part in key.split("."))
        same = _SAME_FOR_ALL.get(str(path.steps[0]))
        ensure(same is None, ValueError(f"can't be swept: {same}"))
        tables = parse_toml(experiment.text, experiment.source)
        taken = path.taken(config_model(), tables)
        _refuse_unsettable(path, tables)
        values = _values(given, plain, seed, taken.length, taken.unit)
        return cls(plain, _axis_name(plain, given.name), taken.unit, *values)

    @property
    def numeric(self) -> bool:
        """Whether its values are numbers or vectors."""
        return not isinstance(self.value(0), str)

    @property
    def columns(self) -> tuple[str, ...]:
        """The keys of its single numbers: ``initial.angular_velocity[0]`` ..."""
        return tuple(f"{self.key}[{i}]" for i in range(self.components)) or (self.key,)

    def exact(self, index: int) -> Numbers:
        """The numbers of one value, SI, in the order of ``columns``."""
        return tuple(self.value(index))

    def text(self, index: int) -> str:
        """A value as written in a config, which identifies it."""
        value = self.value(index)
        if isinstance(value, str):
            return value
        texts = [number.text for number in value]
        return f"[{', '.join(texts)}]" if self.components else texts[0]

    def needed(self, *, product: bool) -> list[str]:
        """Names of its dimensions and variables in a dataset."""
        if not self.components:
            return [self.name]
        return [self.name, f"{self.name}_component", *([f"{self.name}_value"] if product else [])]


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
                be run is known by ``experiment_of(member)``.
        """
        table, config = experiment.config.sweep, experiment.config
        if table is None:
            raise ConfigError(Problem("[sweep]", f"missing; a sweep has one, or {_ASKED}"), experiment.source)
        problems: list[Problem] = []
        axes: list[Axis] = []
        for key, given in table.axes.items():
            try:
                axes.append(Axis.of(key, given, table.seed, experiment))
            except ValueError as error:
                problems.append(Problem(f'[sweep] axes."{key[:60]}"', str(error)))
        problems += _clashes(axes, [event.name for event in config.events], product=table.mode == "product")
        problems += _of_fits(table) if config.fit is not None else []
        if config.output.sensitivity:
            what = "given with [sweep], which keeps none; leave it out, or run its members by themselves"
            problems.append(Problem("[output] sensitivity", what))
        problems = problems or _counts(table, axes)
        if problems:
            raise ConfigError(problems, experiment.source)
        base = experiment.with_overrides(["sweep="])
        if base.config.integrator.hold_invariants == AUTO:  # which members of a sweep haven't
            base = base.with_overrides(["integrator.hold_invariants=false"])
        return cls(experiment, base, tuple(axes))

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
        sizes = tuple(axis.count for axis in self.axes)
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
        return tuple(map(int, np.unravel_index(member, self.shape)))

    def _pairs(self, member: int) -> Iterator[tuple[Axis, int]]:
        return zip(self.axes, self.indices(member), strict=True)

    def texts(self, member: int) -> tuple[str, ...]:
        """The values that identify a member, as written in a config, in the order of the axes."""
        return tuple(axis.text(index) for axis, index in self._pairs(member))

    def described(self, member: int) -> str:
        """The values that identify a member, for people: to six digits, with units."""
        found = []
        for axis, index in self._pairs(member):
            text = axis.text(index)
            if axis.numeric:
                numbers = [f"{float(x):.6g}" for x in axis.exact(index)]
                text = f"[{', '.join(numbers)}]" if axis.components else numbers[0]
                text += f" {axis.unit}" if axis.unit != "1" else ""
            found.append(f"{axis.name} = {text}")
        return ", ".join(found)

    def overrides(self, member: int) -> list[str]:
        """``KEY=VALUE`` texts that turn the base experiment into the member."""
        return [f"{axis.key}={axis.text(index)}" for axis, index in self._pairs(member)]

    def experiment_of(self, member: int, *, writes: bool = True) -> Experiment:
        """The member as a single experiment, whose text has its values if it ``writes`` them; ConfigError
        names a member that a key doesn't take.
        """
        try:
            return self.base.with_overrides(self.overrides(member), writes=writes)
        except ConfigError as error:
            raise self.with_member_named(member, error) from None

    def worked_out(self, member: int) -> Experiment:
        """Like ``experiment_of`` in a tenth of the time, without the member's own text: for checks. A level
        of model that its run chooses by the accuracy asked for is the full one here.

        Raises:
            ConfigError: as for ``experiment_of``.
        """
        experiment = self.experiment_of(member, writes=False)
        config = experiment.config
        if config.model.level == AUTO and config.integrator.accuracy_axis is not None:
            config = config.model_copy(update={"model": config.model.model_copy(update={"level": FULL})})
        return replace(experiment, config=config)

    def with_member_named(self, member: int, error: ConfigError) -> MemberError:
        """The error with the member named besides the key, unless it names the member already. Of what is
        recorded only for indicators, the indicators are named.
        """
        if isinstance(error, MemberError):
            return error
        texts = (text if len(text) <= 40 else text[:37] + "..." for text in self.texts(member))
        named = ", ".join(f"{axis.name} = {text}" for axis, text in zip(self.axes, texts, strict=True))
        problems = []
        for problem in error.problems:
            where, what, added = problem.where, problem.what, f'given "{self.added}": '
            if self.added and what.startswith(added):
                names = ", ".join(f'"{name}"' for name in self.table.keep if name in INDICATORS)
                where, what = "[sweep] keep", f"given {names}: {what.removeprefix(added)}"
            problems.append(Problem(f"[sweep] member {member} ({named})", f"{where}: {what}"))
        return MemberError(problems, self.experiment.source)


def scanned(experiment: Experiment, scan: Sequence[str]) -> Experiment:
    """An experiment with additional sweep axes, by ``KEY=SPEC`` texts: a TOML array of values, a call such as
    ``linspace(from, to, count)``, or a TOML table as ``[sweep] axes`` has it.
    """
    settings = []
    for text in scan:
        key, equals, spec = (part.strip() for part in text.partition("="))
        what = "write KEY=SPEC, such as time.end=[1, 2, 4] or body.mass=linspace(0, 1, 11)"
        ensure(equals and key and spec, ConfigError(Problem(f"--sweep {text[:60]}", what)))
        table = f"{{values = {spec}}}" if spec.startswith("[") else spec
        if call := _CALL.fullmatch(spec):
            way, inside = call[1], call[2]
            ends, _, count = inside.rpartition(",")
            table = f"{{{way} = [{inside}]}}"
            if way in ("uniform", "normal", "sphere"):
                table = f"{{{way} = {ends if way == 'sphere' else f'[{ends}]'}, count = {count}}}"
        try:
            understood = isinstance(tomllib.loads(f"table = {table}")["table"], dict)
        except (ValueError, RecursionError):
            understood = False
        fault = Problem(f"--sweep {text[:60]}", f"given {shown(spec)}; allowed: {_SPECS}")
        ensure(understood, ConfigError(fault))
        settings.append(f'sweep.axes."{key}"={table}')
    return experiment.with_overrides(settings)


_CALL = re.compile(r"(linspace|logspace|step|uniform|normal|sphere)\s*\((.*)\)")
_SPECS = (
    "[1, 2, 4], linspace(from, to, count), logspace(from, to, count), step(from, step, count), "
    "uniform(from, to, count), normal(mean, deviation, count), sphere(radius, count), or a table such as "
    '{values = [1, 2], name = "a"}'
)


# --- what axes can't be -------------------------------------------------------------------------------------


def _axis_name(key: str, given: str | None) -> str:
    """The name given, or the last part of an axis's key: all of it where that is something recorded."""
    name = given
    if name is None:
        parts = [re.sub(r"\[(\d+)\]", r"_\1", re.sub("[\"']", "", part)) for part in key.split(".")]
        parts = [part.replace(",", "_") for part in parts]
        whole = parts[-1] in OBSERVABLES
        name = "_".join(parts if whole else parts[-2:] if parts[-1][:1].isdigit() else parts[-1:])
    what = f"given the name {shown(name)}; allowed: letters, digits and underscores, beginning with a letter"
    ensure(_NAME.fullmatch(name), ValueError(what))
    return name


def _clashes(axes: Sequence[Axis], events: Sequence[str], *, product: bool) -> list[Problem]:
    """Names that the dataset would need twice (events give some, too), and keys that contain one another."""
    problems: list[Problem] = []
    names: dict[str, str] = {}
    for number, axis in enumerate(axes):
        whats, needed = [], axis.needed(product=product)
        double = next((name for name in needed if name in names), None)
        if double is not None:
            also = f'named "{double}"' if double == axis.name else f'named so that it needs "{double}",'
            whats = [f'is {also} like axes."{names[double]}"; give one of them another name']
        elif axis.name.startswith(tuple(f"{event}_" for event in events)) or (
            axis.name.endswith(_OF_LINES) and axis.name.startswith(tuple(OBSERVABLES))
        ):
            whats = [f'is named "{axis.name}", a name that the dataset may need itself; give it another name']
        names |= dict.fromkeys(needed, axis.key)
        for other in axes[:number]:
            pairs = zip(Path.of(axis.key).steps, Path.of(other.key).steps, strict=False)
            if all(one == another for one, another in pairs):
                whats.append(f'sets what axes."{other.key}" sets, too; sweep one of them')
        problems += [Problem(f'[sweep] axes."{axis.key}"', what) for what in whats]
    return problems


def _refuse_unsettable(path: Path, tables: dict[str, Any]) -> None:
    """Refuse a key that a config (``tables``) has no place for, or whose value changes nothing."""
    if path.steps[0] == "parameters" and len(path.steps) == 2:
        name, known = str(path.steps[1]), list(tables.get("parameters", {}))
        word = re.compile(rf"\b{re.escape(name)}\b")
        texts = (x for at, x in leaves(tables) if isinstance(x, str) and not _NO_EXPRESSIONS & {*at.steps})
        there = f"allowed: {', '.join(known)}" if known else "[parameters] has none"
        what = f'no expression uses the parameter "{name}"{nearest(name, known)}; {there}'
        ensure(name in known or any(word.search(text) for text in texts), ValueError(what))
    path.set(tables, 0)


def _of_fits(table: SweepTable) -> list[Problem]:
    """What a sweep of fits can't have."""
    what = "can't be swept: all members estimate the same parameters"
    keys = [key for key in table.axes if re.fullmatch(r"\s*fit\s*(\.\s*parameters\b.*)?", key)]
    problems = [Problem(f'[sweep] axes."{key[:60]}"', what) for key in keys]
    if "keep" in table.model_fields_set:
        what = "given with [fit]: each member is a fit, whose results are always kept; leave keep out"
        problems.insert(0, Problem("[sweep] keep", what))
    return problems


def _counts(table: SweepTable, axes: Sequence[Axis]) -> list[Problem]:
    """Axes of incompatible lengths, or with too many members."""
    sizes = [axis.count for axis in axes]
    if table.mode == "zip" and len(set(sizes)) > 1:
        given = ", ".join(f'"{axis.key}" {axis.count}' for axis in axes)
        what = f'given "zip", which needs axes of one length: {given}; or choose mode = "product"'
        return [Problem("[sweep] mode", what)]
    if table.mode == "zip" and "member" in {axis.name for axis in axes}:
        return [Problem("[sweep] axes", 'the name "member" is taken; give that axis another')]
    if table.mode == "product" and (count := math.prod(sizes)) > MOST_MEMBERS:
        given, about = " x ".join(f"{size:,}" for size in sizes), f"{count:.3g}".replace("e+", "e")
        what = f"ask for {given} = {about} members; at most 1e8 are allowed: take fewer values"
        return [Problem("[sweep] axes", what)]
    return []


# --- values of axes -----------------------------------------------------------------------------------------


def _values(table: AxisTable, key: str, seed: int, length: int, unit: str) -> _Values:
    """The values that a table of ``[sweep] axes`` asks for; ValueError says what is allowed.

    The key takes a vector of so many components (0: a number) in an SI unit ("1": none, as expressions do).
    """
    given, way = getattr(table, table.way), table.way
    if way == "values":
        return _listed(given, products=unit == "1")
    if way == "sphere":
        what = "sphere is for keys that take a vector, such as initial.angular_velocity"
        ensure(length >= 3, ValueError(what))
        radius = parse_number(given)
        ensure(radius.sign > 0, ValueError(f"given {shown(given)}; a radius above zero is allowed"))
        if table.grid is None:
            return _counted(table.count), length, _random_directions(radius, key, seed, length)
        what = "a grid on the sphere is for vectors of three; give count for random ones"
        ensure(length == 3, ValueError(what))
        return _counted(math.prod(table.grid)), 3, _grid_of_directions(radius, *table.grid)
    if way in ("normal", "uniform"):
        return _counted(table.count), *_random_values(way, given, key, seed, length)
    count, (first, last) = _counted(given[2]), _alike(*given[:2])
    begin, end = first.rational, last.rational
    if way == "step":
        return count, 0, lambda i: (_other(begin + i * end, first),)
    what = f"given a count of {count}; at least 2 are needed, both ends being included"
    ensure(count >= 2, ValueError(what))
    if way == "linspace":
        return count, 0, lambda i: (_other(begin + (end - begin) * i / (count - 1), first),)
    what = "both ends of a logspace must be above zero, or both below"
    ensure(first.sign * last.sign > 0, ValueError(what))
    return count, 0, _geometric(first, last, count)


def _counted(count: Any) -> int:
    whole = isinstance(count, int) and not isinstance(count, bool) and 1 <= count <= LARGEST_AXIS
    ensure(whole, ValueError(f"given a count of {shown(count)}; whole numbers from 1 to 1e7 are allowed"))
    return int(count)


def _other(rational: Fraction, like: ExactNumber) -> ExactNumber:
    """Another number in the unit of one."""
    return ExactNumber(rational, like.pi_power, like.unit)


def _alike(*given: Any) -> list[ExactNumber]:
    """Numbers in a common unit, with a common power of pi; ValueError if there is none."""
    numbers = [parse_number(value) for value in given]
    some = [x for x in numbers if x.sign]
    turns, written = {x.pi_power for x in some or numbers[:1]}, {x.unit for x in numbers}
    common = len(turns) == 1 and (len(written) == 1 or all(x.unit for x in some))
    ensure(common, ValueError(f"given {' and '.join(map(shown, given))}; write both in one unit"))
    unit, power = written.pop() if len(written) == 1 else "", turns.pop()
    return [ExactNumber(x.rational, power, unit) for x in numbers]


def _listed(given: Sequence[Any], *, products: bool) -> _Values:
    """A list's numbers or vectors, otherwise words; ``products``: whether ``2*t`` may be twice the time."""
    vectors = all(isinstance(value, list) for value in given) and len({len(value) for value in given}) == 1
    entries = given if vectors else [[value] for value in given]
    ensure(len(given) <= LARGEST_AXIS, ValueError(f"given {len(given)} values; at most 1e7 are allowed"))
    try:
        numbers = [tuple(_number(x, products=products) for x in entry) for entry in entries]
        return len(given), len(given[0]) if vectors else 0, numbers.__getitem__
    except ValueError:
        if not any(isinstance(value, bool | str | list | dict) for value in given):
            raise  # for instance nan, which no key takes
        words = [inline(value) for value in given]
        return len(given), 0, words.__getitem__


def _number(value: Any, *, products: bool) -> ExactNumber:
    """A number; ValueError for a text that only begins like one: a date, or an expression."""
    number = parse_number(value)
    if number.unit and products and re.search(r"[\d.)i]\s*\*\s*[A-Za-z]", value):
        raise ValueError("an expression")
    return number


def _context() -> Any:
    """A context in which values that aren't rational are worked out, before they are ``_rounded``."""
    context = mpmath.MPContext()
    context.dps = DIGITS + 20
    return context


def _rounded(value: Fraction) -> Fraction:
    """The nearest number of ``DIGITS`` decimal digits."""
    if not value:
        return value
    size = abs(value)
    magnitude = math.floor(math.log10(size.numerator) - math.log10(size.denominator))
    scale = Fraction(10) ** (DIGITS - 1 - magnitude)
    return round(value * scale) / scale


def _geometric(begin: ExactNumber, end: ExactNumber, count: int) -> Callable[[int], Numbers]:
    """Values between two of one unit, in SI; they are rounded in that unit."""
    context = _context()
    first, last = begin.in_its_unit.rational, end.in_its_unit.rational
    ratio = context.log(context.mpf(last.numerator) / last.denominator * first.denominator / first.numerator)

    @cache
    def value(index: int) -> Numbers:
        if index in (0, count - 1):
            return (_other((end if index else begin).rational, begin),)
        power = context.exp(ratio * index / (count - 1))
        found = _rounded(fraction_of(power * first.numerator / first.denominator))
        return (_other(found * begin.rational / first, begin),)

    return value


_DEVIATION = 10**14
"""Draws from the normal distribution are rounded to this fraction of the deviation: fewer digits than double
precision has, so that mathematical libraries that differ in the last bit give the same draws.
"""
_PLACES = 10**18
"""Number of equal parts into which uniform draws divide the interval from 0 to 1."""
_UNIT, _WIDE = 10**DIGITS, 10 ** (DIGITS + 5)  # of points on a sphere
_SUCH_AS = {"normal": "[[0, 0, 1], [0.1, 0.1, 0.1]]", "uniform": "[[0, 0, 0], [1, 1, 1]]"}

_Draw = Callable[[int], int]
_quantile = NormalDist().inv_cdf  # Wichura 1988, algorithm AS 241


def _uniform(seed: int, key: str, component: int) -> _Draw:
    """Uniform draws between 0 and 1, both excluded, by index, in units of ``1 / (2 _PLACES)``."""
    begun = hashlib.blake2b(f"{seed}\n{key}\n".encode(), digest_size=8)

    def draw(index: int) -> int:
        name = begun.copy()
        name.update(b"%d\n%d" % (index, component))
        return 2 * (int.from_bytes(name.digest(), "big") * _PLACES >> 64) + 1

    return draw


def _normal(seed: int, key: str, component: int) -> _Draw:
    """Normal draws of mean 0 and deviation 1, by index, in units of ``1 / _DEVIATION``."""
    shares = _uniform(seed, key, component)

    def draw(index: int) -> int:
        share = shares(index)
        below = share < _PLACES
        size = round(_quantile((share if below else 2 * _PLACES - share) / (2 * _PLACES)) * _DEVIATION)
        return size if below else -size

    return draw


def _random_values(
    way: str, given: Sequence[Any], key: str, seed: int, length: int
) -> tuple[int, Callable[[int], Numbers]]:
    """Components and values drawn at random; ``way`` is "uniform" or "normal"."""
    vectors = [value for value in given if isinstance(value, list)]
    components = len(vectors[0]) if vectors else 0
    same = all(len(vector) == components for vector in vectors)
    ensure(same, ValueError(f"given vectors of different lengths in {way}"))
    what = f"the key takes a vector of {length}; give vectors, such as {way} = {_SUCH_AS[way]}"
    ensure(vectors or not length, ValueError(what))
    lines = []
    for k in range(components or 1):
        first, second = _alike(*(value[k] if isinstance(value, list) else value for value in given))
        if way == "uniform":
            draw, step = _uniform(seed, key, k), (second.rational - first.rational) / (2 * _PLACES)
            what = "the first end of a uniform interval must not be above the second"
        else:
            draw, step = _normal(seed, key, k), second.rational / _DEVIATION
            what = "a standard deviation of zero or more is allowed"
        ensure(step >= 0, ValueError(what))
        below = math.lcm(first.rational.denominator, step.denominator)  # fractions take four times as long
        lines.append((draw, int(first.rational * below), int(step * below), below, first))
    return components, lambda index: tuple(
        _other(Fraction(first + step * draw(index), below), like) for draw, first, step, below, like in lines
    )


def _random_directions(radius: ExactNumber, key: str, seed: int, length: int) -> Callable[[int], Numbers]:
    """Random points of uniform density on a sphere: normal draws scaled to its radius."""
    normals = [_normal(seed, key, component) for component in range(length)]

    def value(index: int) -> Numbers:
        whole = [draw(index) for draw in normals]
        norm = math.isqrt(sum(n * n for n in whole) * _WIDE**2)
        unit = [Fraction((2 * n * _WIDE * _UNIT + norm) // (2 * norm), _UNIT) for n in whole]
        return tuple(_other(radius.rational * x, radius) for x in unit)

    return value


def _grid_of_directions(radius: ExactNumber, polar: int, azimuths: int) -> Callable[[int], Numbers]:
    """Centres of cells of equal area on a sphere; the azimuth varies fastest."""
    context = _context()

    @cache
    def sine_and_cosine(j: int) -> tuple[Fraction, Fraction]:
        cosine = 1 - Fraction(2 * j + 1, polar)
        square = 1 - cosine * cosine
        return fraction_of(context.sqrt(context.mpf(square.numerator) / square.denominator)), cosine

    @cache
    def around(k: int) -> tuple[Fraction, Fraction]:
        angle = context.mpf(2 * k + 1) / azimuths
        return fraction_of(context.cospi(angle)), fraction_of(context.sinpi(angle))

    def value(index: int) -> Numbers:
        sine, cosine = sine_and_cosine(index // azimuths)
        point = (*(sine * x for x in around(index % azimuths)), cosine)
        return tuple(_other(radius.rational * _rounded(x), radius) for x in point)

    return value
