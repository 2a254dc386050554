"""From TOML text to a validated config that keeps every digit as written.

The text is read within bounded time and memory; values are replaced in a config's tables and in place in its
text (``--set KEY=VALUE``), and written of Python values, for configs in code.
"""

from __future__ import annotations

import copy
import hashlib
import numbers
import os
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from dataclasses import replace as exchanged
from datetime import date, time
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, TextIO

import tomlkit
from pydantic import ValidationError
from tomlkit.exceptions import TOMLKitError

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene import validation_messages as messages
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.bodies.files import is_mesh, moments_of
from rigidsim.scene.bodies.gravity_field import asked_degree, cut
from rigidsim.scene.exact import ExactNumber, fraction_of
from rigidsim.scene.fields import NAME_OR_VECTOR
from rigidsim.scene.kernels.reading import EMBEDDED, KernelError, find_file, folders_of
from rigidsim.scene.paths import Path as Address
from rigidsim.scene.paths import leaves
from rigidsim.scene.registry import LOADS
from rigidsim.scene.schema import Config, TableText, config_error, config_model
from rigidsim.scene.validation_messages import LONGEST_INTEGER, shown

# The TOML reader's time and memory grow with the square of a dotted key's length. (Runs of keys, quoted or
# bare, joined by points; the look-behind lets the search pass over each run once.)
_DEEPEST_KEY = 100
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_DEEP_KEY = re.compile(rf"(?<![\w.-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{_DEEPEST_KEY}}}")
_SURROGATE = re.compile("[\ud800-\udfff]")


def decimal(text: str) -> Decimal:
    """A number of a TOML text; ``ValueError`` if it is out of range."""
    try:
        return Decimal(text.replace("_", ""))
    except InvalidOperation:  # an exponent past what Decimal itself holds
        raise ValueError(f"the number {text[:40]} is out of range") from None


_FINE_DATE = re.compile(r"^[^#\"'\n]*=\s*(\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d:\d\d\.\d{7,})", re.MULTILINE)


def _refuse_fine_dates(text: str) -> None:
    """Refuse dates of TOML's own whose seconds have more decimals than its reader keeps."""
    if (found := _FINE_DATE.search(text)) is not None:
        line = text.count("\n", 0, found.start(1)) + 1
        raise ValueError(f"a date with more than 6 decimals of a second (at line {line}); write it in quotes")


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """The tables of a TOML text, decimals kept as written."""
    return copy.deepcopy(_parsed(text, source))


@lru_cache(4)
def _parsed(text: str, source: str) -> dict[str, Any]:
    """The tables, read once for all members of a sweep: a table of an orbit may have megabytes."""
    hindrances = (
        (_DEEP_KEY, f"a key of more than {_DEEPEST_KEY} parts (at line {{}})"),
        # of an argument or a file name that isn't UTF-8
        (_SURROGATE, "holds bytes that are no UTF-8 text (at line {}); write it in UTF-8"),
    )
    for pattern, what in hindrances:
        if found := pattern.search(text):
            line = text.count("\n", 0, found.start()) + 1
            raise ConfigError(Problem("TOML", f"can't be read: {what.format(line)}"), source)
    try:
        _refuse_fine_dates(text)
        return tomllib.loads(text, parse_float=decimal)
    except RecursionError:
        raise ConfigError(Problem("TOML", "can't be read: nested too deeply"), source) from None
    except ValueError as error:
        why = re.sub(r"\(('[^()]*'),?\)", _dotted, str(error))
        raise ConfigError(Problem("TOML", f"can't be read: {why}{_remedy(text, why)}"), source) from None


def long_integers(table: dict[str, Any]) -> list[Problem]:
    """Problems of whole numbers too long to be shown; TOML sets no limit for hexadecimal ones."""
    most = LONGEST_INTEGER
    return [
        Problem(path.where, f"given {shown(value)}; whole numbers of at most {most} bits are allowed")
        for path, value in leaves(table)
        if isinstance(value, int) and value.bit_length() > most
    ]


_PLACE = re.compile(r"\(at line (\d+), column (\d+)\)")
_ASSIGNMENT = re.compile(r"\s*[\w.\"'-]+\s*=\s*(?P<value>[^\s#\"'\[{][^#\"'\[{]*?)\s*(?:#.*)?")
_LONGEST_SHOWN = 60


def _remedy(text: str, why: str) -> str:
    """The line at fault, and a remedy if a text or a unit lacks its quotes."""
    place = _PLACE.search(why)
    lines = text.split("\n")
    if place is None or not 0 < int(place[1]) <= len(lines):
        return ""
    line = lines[int(place[1]) - 1].strip()
    match = _ASSIGNMENT.fullmatch(line) if len(line) <= _LONGEST_SHOWN else None
    if match is None:
        return f": {line}" if 0 < len(line) <= _LONGEST_SHOWN else ""
    return f'; texts, and numbers with units, need quotes: "{match["value"]}"'


def _dotted(key: re.Match[str]) -> str:
    """A dotted key as the user wrote it; tomllib shows it as a Python tuple."""
    return '"' + key[1].strip("'").replace("', '", ".") + '"'


_MOST_OVERRIDES = 1000
FLAG = "--set"
"""Name of overrides from the command line."""


def apply_overrides(table: dict[str, Any], overrides: Sequence[str], what: str = FLAG) -> None:
    """Replace values of a config's tables, in order.

    Each override is a dotted key with optional [index], an equals sign and a TOML value (anything else, such
    as a bare word or a number with its unit, is a string); nothing after the equals sign removes the key.
    Messages call them ``what``.
    """
    many = f"given {len(overrides)} values to set; at most {_MOST_OVERRIDES} are allowed"
    ensure(len(overrides) <= _MOST_OVERRIDES, ConfigError(Problem(what, many)))
    _apply(table, overrides, what, _plain_value)


def written(text: str, overrides: Sequence[str], meant: dict[str, Any], source: str, what: str = FLAG) -> str:
    """A text with values replaced in place, in the digits given, so that its tables are ``meant``."""
    try:
        document = tomlkit.parse(text)
        _apply(document, overrides, what, _written_value)
        result = document.as_string()
        if parse_toml(result, source) == meant:
            return result
    except (TOMLKitError, ConfigError, ValueError, TypeError, RecursionError):
        pass  # a text that the other reader takes and this one doesn't: none is known
    why = "can't be written into this text; edit the file instead"
    raise ConfigError(Problem(f"{what} {overrides[-1][:60]}", why), source)


def _apply(table: dict[str, Any], overrides: Sequence[str], what: str, read: Callable[[str], Any]) -> None:
    for assignment in overrides:
        where = f"{what} {assignment[:60]}"
        key, equals, text = (part.strip() for part in assignment.partition("="))
        fault = Problem(where, "write KEY=VALUE on one line, such as time.end=10")
        ensure(equals and key and "\n" not in assignment, ConfigError(fault))
        deep = Problem(where, f"a key of more than {_DEEPEST_KEY} parts")
        ensure(not _DEEP_KEY.search(assignment), ConfigError(deep))
        try:
            value = read(text) if text else None
        except (ValueError, RecursionError):
            value = text
        try:
            Address.of(key).set(table, value)
        except ValueError as error:
            raise ConfigError(Problem(where, str(error))) from None


def _plain_value(text: str) -> Any:
    _refuse_fine_dates(f"= {text}")
    return tomllib.loads(f"value = {text}", parse_float=decimal)["value"]


def _written_value(text: str) -> Any:
    _refuse_fine_dates(f"= {text}")
    value: Any = tomlkit.parse(f"value = {text}\n").item("value")
    value.trivia.comment = value.trivia.comment_ws = ""
    return value


def assignments(text: str, keys: Sequence[str]) -> list[str]:
    """``KEY=VALUE`` in the config's own digits for the keys (``table.key``) that it has."""
    document = tomlkit.parse(text)
    found = []
    for key in keys:
        table, _, name = key.partition(".")
        if name in document.get(table, {}):
            found.append(f"{key}={document[table][name].as_string()}")
    return found


# --- Python values ------------------------------------------------------------------------------------------

_DEEPEST = 50
_ALLOWED = (
    "numbers (int, float, Decimal, Fraction, mpf, numpy's), strings, booleans, dates, lists, "
    "arrays and dictionaries are allowed"
)


def toml_text(tables: Mapping[str, Any]) -> str:
    """The TOML text of a config given as nested dictionaries; None counts as not given.

    Floats, numpy's too, count as the shortest decimal that denotes them, which is how they print: ``0.1`` is
    one tenth. Decimals, fractions and mpmath's numbers count exactly.
    """
    document = tomlkit.document()
    for key, value in tables.items():
        plain = _plain(value)
        if isinstance(plain, Mapping):
            document[_key(key)] = _table(plain, key)
        elif isinstance(plain, list) and plain and all(isinstance(entry, Mapping) for entry in plain):
            document[_key(key)] = tomlkit.aot()
            for number, entry in enumerate(plain):
                document[key].append(_table(entry, f"{key}[{number}]"))
        elif value is not None:
            document[_key(key)] = tomlkit.value(inline(value, str(key)))
    return document.as_string()


def _table(tables: Mapping[str, Any], where: str) -> Any:
    table = tomlkit.table()
    for key, value in tables.items():
        if value is not None:
            table[_key(key)] = tomlkit.value(inline(value, f"{where}.{key}"))
    return table


def assignments_of(changes: Mapping[str, Any]) -> list[str]:
    """Values to replace as ``KEY=VALUE``; a dictionary changes its keys of a table, None removes a key."""
    found = []
    for key, value in changes.items():
        if isinstance(value, Mapping):
            mark = '"' if key == "sweep.axes" else ""  # whose keys are dotted themselves
            found += assignments_of(
                {f"{key}.{mark}{_key(inner)}{mark}": given for inner, given in value.items()}
            )
        else:
            found.append(f"{_key(key)}={'' if value is None else inline(value, str(key))}")
    return found


def inline(value: Any, where: str = "value", depth: int = 0) -> str:
    """A TOML value on one line."""
    plain = _plain(value)
    ensure(depth <= _DEEPEST, ConfigError(Problem(where, "nested too deeply")))
    if isinstance(plain, str):
        return tomlkit.string(plain).as_string()
    if isinstance(plain, bool | int):
        return str(plain).lower()
    if isinstance(plain, Decimal):
        ensure(plain.is_finite(), ConfigError(Problem(where, f"given {plain}; finite numbers are allowed")))
        text = str(plain).lower().replace("e+", "e")
        return text if "." in text or "e" in text else f"{text}.0"
    if isinstance(plain, Mapping):
        named = (
            (tomlkit.string(_key(k)).as_string(), inline(v, f"{where}.{k}", depth + 1))
            for k, v in plain.items()
        )
        return "{" + ", ".join(f"{key} = {text}" for key, text in named) + "}"
    if isinstance(plain, list):
        entries = (inline(entry, f"{where}[{n}]", depth + 1) for n, entry in enumerate(plain))
        return "[" + ", ".join(entries) + "]"
    raise ConfigError(Problem(where, f"given {shown(value)}; {_ALLOWED}"))


def _plain(value: Any) -> Any:
    """A value of Python's own, or of a related type, as bool, int, Decimal, str, list or mapping."""
    if isinstance(value, bool | str | int | Decimal | Mapping):
        return value
    if isinstance(value, date | time):
        return value.isoformat()
    kind = value.dtype.kind if hasattr(value, "dtype") else ""
    if kind and value.shape:  # an array; its elements keep their kind
        return list(value)
    if kind == "b":
        return bool(value)
    if isinstance(value, Fraction):
        return f"{value.numerator}/{value.denominator}" if value.denominator != 1 else value.numerator
    if hasattr(value, "_mpf_"):
        _, mantissa, exponent, _ = value._mpf_
        if exponent and not mantissa:  # infinite, or not a number
            return value
        exact = fraction_of(value)
        power = exact.denominator.bit_length() - 1  # of two
        return Decimal(f"{exact.numerator * 5**power}e{-power}")
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real) or kind == "f":
        return Decimal(_shortest(value))
    if hasattr(value, "magnitude") and hasattr(value, "units"):  # a quantity of pint
        return f"{_shortest(value.magnitude)} {value.units:~C}"
    if isinstance(value, Sequence):
        return list(value)
    return value


def _shortest(value: Any) -> str:
    """The shortest decimal that denotes a number, without numpy's wrapping."""
    text = str(value)
    return text[text.find("(") + 1 : text.find(")")].strip("'") if "(" in text else text


def _key(key: Any) -> str:
    if not isinstance(key, str) or not key:
        raise ConfigError(Problem("config", f'given the key {shown(key)}; a key is a text, such as "end"'))
    return key


# --- experiments --------------------------------------------------------------------------------------------


Overrides = Sequence[str] | Mapping[str, Any]
"""Values to replace: ``KEY=VALUE`` texts, or dotted keys with Python values."""
NEW = "the command rigidsim new lists commented ones to start from"
_LARGEST_TABLE = 3_000_000  # characters
_LARGEST_FILE = 4_000_000  # bytes; a body of tens of thousands of points still fits


@dataclass(frozen=True, repr=False)
class Experiment:
    """A config as given, and its meaning; made by ``load``, ``parse`` or ``from_dict``.

    Attributes:
        text: TOML text of what is run: each key has one visible value.
        config: the validated tables.
        source: origin of the config, for messages.
        given: the TOML text as it was given, before any value was replaced.
        settings: the ``KEY=VALUE`` texts given with it, in order.
    """

    text: str
    config: Config
    source: str
    given: str
    settings: tuple[str, ...] = ()

    @property
    def sha256(self) -> str:
        """SHA-256 of the TOML text of what is run."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def long_tables(self) -> list[Path]:
        """Files of tables that are too long to be copied into the config."""
        given = parse_toml(self.text, self.source).get("tables", {})
        return [find_file(name, self.source, "a table") for name, table in given.items() if "sha256" in table]

    @property
    def files(self) -> list[Path]:
        """The files that the experiment is read from: its config, or the dataset that embeds it, and those
        that it names as values and that lie where they are looked for; none for an experiment from Python.
        """
        path = Path(self.source.removesuffix(EMBEDDED))
        folders = folders_of(self.source)
        texts = [name for text in texts_in(self.to_dict()) for name in (text, Path(text).name)]
        named = [folder / text for text in texts for folder in folders]
        return [file for file in dict.fromkeys([path, *named]) if os.path.isfile(file)]

    def with_overrides(self, overrides: Sequence[str], *, writes: bool = True) -> Experiment:
        """The experiment with values replaced by the program rather than the user; see ``parse``. Unless it
        ``writes`` them, the text stays and it takes a tenth of the time: for runs that nobody keeps.
        """
        other = _read(self.text, self.source, overrides, writes=writes)
        return exchanged(other, given=self.given, settings=self.settings)

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any], *, source: str = "config") -> Experiment:
        """An experiment written in Python: the tables of a config as nested dictionaries.

        Floats count as the decimal that they print as (``0.1`` is one tenth); Decimals, Fractions, numbers of
        mpmath, and strings such as ``"1/3"`` or ``"430 day"`` count exactly.

        Args:
            tables: ``{"name": .., "body": {..}, "loads": [{..}], ..}``; None counts as not given.
            source: its name in messages.

        Raises:
            ConfigError: with every problem found.
        """
        return parse(toml_text(tables), source=source)

    def to_dict(self) -> dict[str, Any]:
        """The tables as nested dictionaries; numbers that aren't whole are Decimals with all digits."""
        return parse_toml(self.text, self.source)

    def replace(self, changes: Mapping[str, Any] | None = None, /, **tables: Any) -> Experiment:
        """The experiment with other values, such as ``replace({"time.end": 10})`` or ``replace(time={"end":
        10})``.

        Args:
            changes: dotted keys with optional [index], ``"initial.angular_velocity[0]"``, to values as in
                ``from_dict``. None removes a key: ``replace(time={"samples": None, "times": [0, 1, 10]})``.
            tables: tables with the keys to change, or ``name`` and ``description``.

        Raises:
            ConfigError: with every problem found.
        """
        if changes is not None and not isinstance(changes, Mapping):
            what = f'given {messages.shown(changes)}; keys and values are allowed: {{"time.end": 10}}'
            raise ConfigError(Problem("replacing", what), self.source)
        other = parse(self.text, source=self.source, overrides={**(changes or {}), **tables})
        return exchanged(other, given=self.given, settings=(*self.settings, *other.settings))

    def quiet(
        self,
        record: Sequence[str] | None = None,
        times: Iterable[float | Fraction] | None = None,
        *,
        estimate: bool = False,
        **tables: Any,
    ) -> Experiment:
        """The same motion with nothing made but samples: no timeline, exponents, derivatives. The text stays.

        Args:
            record: the variables recorded, without a published orientation; by default what the config asks
                for.
            times: exact times of the samples, s, from start on in either direction; by default as the config
                says.
            estimate: whether the errors are estimated.
            tables: other tables of the config.
        """
        output = self.config.output
        found: dict[str, Any] = {
            "timeline": False,
            "lyapunov": False,
            "sensitivity": None,
            "estimate": estimate,
        }
        if record is not None:
            tip = output.tip if "tip" in record else None
            found |= {"record": list(record), "orientation": None, "orientation_of": None, "tip": tip}
        tables["output"] = output.model_copy(update=found)
        if times is not None:
            listed: dict[str, Any] = {"times": [ExactNumber(Fraction(time)) for time in times]}
            others = dict.fromkeys(("end", "samples", "every"))
            tables["time"] = self.config.time.model_copy(update=listed | others)
        return exchanged(self, config=self.config.model_copy(update=tables))

    def ways(self, times: Iterable[float]) -> tuple[list[Fraction], list[Fraction]]:
        """Ascending times (s) as the exact ones of two runs from start, backwards and forwards. The double
        nearest to start is start.
        """
        start = self.config.time.start.fraction(context_for(self.config.integrator.precision))
        exact = [start if time == float(start) else Fraction(time) for time in times]
        early = sum(time < start for time in exact)
        split = len(exact) if early and exact[-1] == start else early  # no run for the start alone
        return exact[:split][::-1], exact[split:]

    def __repr__(self) -> str:
        loads = ", ".join(load.kind for load in self.config.loads) or "no load"  # type: ignore[attr-defined]
        end = self.config.time.end
        until = "" if end is None else f", to t = {float(end):g} s"
        precision = self.config.integrator.precision
        return f"<Experiment {self.config.name!r} ({self.source}): {loads}{until}, {precision}>"

    def _repr_html_(self) -> str:
        from html import escape  # which only notebooks need

        return f"<b>{escape(self.config.name)}</b><pre>{escape(self.text)}</pre>"


def texts_in(tables: Mapping[str, Any]) -> Iterator[str]:
    """Strings in tables by which a file may be named, and names of tables that stand in the config by now."""
    for path, value in leaves(tables):
        if isinstance(value, str) and "\n" not in value:
            yield value
        if path.steps[1:] and path.steps[-1] == "text":
            yield str(path.steps[-2])


def parse(text: str, *, source: str = "config", overrides: Overrides = ()) -> Experiment:
    """Read a TOML text.

    Args:
        text: the config.
        source: its name in messages.
        overrides: ``KEY=VALUE`` texts that replace values, in order; or a dictionary as for
            ``Experiment.replace``.

    Raises:
        ConfigError: with every problem found.
    """
    return _read(text, source, overrides, writes=True)


def _read(text: str, source: str, overrides: Overrides, *, writes: bool) -> Experiment:
    table = parse_toml(text, source)
    what = FLAG
    if isinstance(overrides, Mapping):
        what, overrides = "replacing", assignments_of(overrides)
    try:
        apply_overrides(table, overrides, what)
    except ConfigError as error:
        raise error.at(source) from None
    config = validated(table, source)
    run = written(text, overrides, table, source, what) if overrides and writes else text
    return Experiment(run, config, source, text, tuple(line.strip() for line in overrides))


def validated(table: dict[str, Any], source: str) -> Config:
    """The tables of a config, validated."""
    problems = long_integers(table)
    if problems:
        raise ConfigError(problems, source)
    if not table:
        problems.append(Problem("config", f"it is empty; {NEW}"))
    model = config_model() if "loads" in table else Config  # kinds of loads take time to import
    try:
        config = model.model_validate(table, context=table)
    except ValidationError as error:
        problems += config_error(model, table, error, {*NAME_OR_VECTOR, *LOADS["kind"]}).problems
    if problems:
        raise ConfigError(problems, source)
    long = {name: table.sha256 for name, table in config.tables.items() if table.sha256 is not None}
    if not long:
        return config
    try:
        read = {name: TableText(text=_text_of(name, digest, source)) for name, digest in long.items()}
    except ConfigError as error:
        raise error.at(source) from None
    return config.model_copy(update={"tables": {**config.tables, **read}})


def _text_of(name: str, digest: str, source: str) -> str:
    """The text of a long table, which is looked for where kernels are.

    Raises:
        ConfigError: it isn't there, or another file is.
    """
    where = f'[tables."{name}"]'
    try:
        path = find_file(name, source, "a table")
        status = path.stat()
        found, text = _long_text(path, status.st_size, status.st_mtime_ns)
    except (KernelError, OSError, UnicodeDecodeError) as error:
        raise ConfigError(Problem(where, f"given the sha256 of a file, {error}")) from None
    what = f"given sha256 {digest[:12]}..., but {path} has {found[:12]}...; put there what the run began with"
    ensure(found == digest, ConfigError(Problem(where, what)))
    return text


@lru_cache(4)
def _long_text(path: Path, size: int, changed: int) -> tuple[str, str]:
    """SHA-256 and text of a file as it is now."""
    data = path.read_bytes()
    text = data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    return hashlib.sha256(data).hexdigest(), text


def load(path: str | Path, *, overrides: Overrides = ()) -> Experiment:
    """Read a config file together with the table files that it names; see ``parse``.

    Raises:
        ConfigError: no path is given, or the file is missing, not text, too large, or a bad config.
    """
    what = f"given {messages.shown(path)}; the path of a config is allowed (pass tables to run directly, or "
    ensure(isinstance(path, str | Path), ConfigError(Problem("path", what + "to Experiment.from_dict)")))
    path = Path(path)

    def fault(what: str) -> ConfigError:
        return ConfigError(Problem("file", what), str(path))

    if path.is_dir() and (path / "config.toml").is_file():
        raise fault(f"is a run folder; its config is {path / 'config.toml'}")
    try:
        size = path.stat().st_size
        ensure(size <= _LARGEST_FILE, fault(f"{size} bytes; a config has at most {_LARGEST_FILE}"))
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        hint = f"; {NEW}" if isinstance(error, FileNotFoundError) else ""
        raise fault(f"can't be read: {error.strerror or error}{hint}") from None
    except UnicodeDecodeError as error:
        raise fault(f"not UTF-8 text (byte {error.start}); save it as UTF-8") from None
    experiment = parse(text, source=str(path), overrides=overrides)
    try:
        added = _table_sections(experiment.config, path.parent)
    except ConfigError as error:
        raise error.at(experiment.source) from None
    if not added:
        return experiment
    text, given = (f"{x.rstrip()}\n{added}" for x in (experiment.text, experiment.given))
    config = validated(parse_toml(text, experiment.source), experiment.source)
    return exchanged(experiment, text=text, given=given, config=config)


def _table_sections(config: Config, folder: Path) -> str:
    """TOML text, to be appended to the config, of files that it names and doesn't contain, so that the
    experiment depends on no other file.
    """
    found: dict[str, str] = {}
    for at, name in leaves(config):
        kind = at.taken(type(config), config).beside if isinstance(name, str) else ""
        if not kind or name in found or name in config.tables:
            continue
        path, begin, read = folder / name, f"\n[tables.{inline(name)}]\n", _whole
        if kind == "times":
            read = _times_of
        elif kind == "field":
            degree = asked_degree(at.parent.get(config), config.loads, config.sweep)
            read = partial(cut, degree=degree)
        elif kind == "solid" and is_mesh(name):
            read = _mesh
        elif path.is_file() and (status := path.stat()).st_size > _LARGEST_TABLE:
            digest, _ = _long_text(path.absolute(), status.st_size, status.st_mtime_ns)
            found[name] = f'{begin}sha256 = "{digest}"\n'
            continue
        found[name] = f"{begin}text = '''\n{_text(at.where, name, path, read).rstrip()}\n'''\n"
    return "".join(found.values())


_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")


def _text(where: str, name: str, path: Path, read: Callable[[TextIO], str]) -> str:
    """What is read of a file."""

    def fault(what: str) -> ConfigError:
        return ConfigError(Problem(where, f'given "{name}"{what}'))

    what = f", which is a folder or a device: {path}; a file next to the config is allowed"
    ensure(path.is_file() or not path.exists(), fault(what))
    try:
        with path.open(encoding="utf-8-sig") as file:
            text = read(file)
    except OSError as error:
        what = f", which can't be read ({error.strerror or error}): {path} is looked for, next to the config"
        raise fault(what) from None
    except UnicodeDecodeError:
        raise fault(", which is not UTF-8 text; save it as such") from None
    except ValueError as error:  # of a table without times, or a mesh without a volume
        raise fault(f": {error}") from None
    what = f", which has more than {_LARGEST_TABLE} characters; keep the rows and digits that the run needs"
    ensure(len(text) <= _LARGEST_TABLE, fault(what))
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    odd = "'''" in text or _CONTROL.search(text) is not None
    ensure(not odd, fault(", which holds characters that no table has; save it as plain text"))
    return text


def _whole(file: TextIO) -> str:
    return file.read(_LARGEST_TABLE + 1)


def _mesh(file: TextIO) -> str:
    return moments_of(Path(file.name))  # which may be binary


def _times_of(file: TextIO) -> str:
    from rigidsim.scene.text_tables import time_column  # which few configs need

    def again() -> TextIO:
        file.seek(0)
        return file

    return time_column(again)
