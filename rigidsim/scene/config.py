"""From TOML text to a validated config, with every digit as it was written."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from itertools import pairwise
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import validation_messages as messages
from rigidsim.scene.registry import LOAD_KINDS
from rigidsim.scene.schema import POINT_OR_NAME, Config, config_model

_LARGEST_FILE = 4_000_000  # bytes; a body of tens of thousands of points still fits
_MOST_OVERRIDES = 1000
# The TOML reader's time and memory grow with the square of a dotted key's length. (Runs of keys, quoted or
# bare, joined by points; the look-behind lets the search pass over each run once.)
_DEEPEST_KEY = 100
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_DEEP_KEY = re.compile(rf"(?<![\w.-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{_DEEPEST_KEY}}}")


@dataclass(frozen=True)
class Experiment:
    """A config as given, and its meaning.

    Attributes:
        text: the TOML text; with overrides applied it says so in comments at its end.
        config: the validated tables.
        source: where it came from, for messages.
    """

    text: str
    config: Config
    source: str

    @property
    def sha256(self) -> str:
        """Of the TOML text."""
        return hashlib.sha256(self.text.encode()).hexdigest()


def _decimal(text: str) -> Decimal:
    try:
        return Decimal(text.replace("_", ""))
    except InvalidOperation:  # an exponent past what Decimal itself holds
        raise ValueError(f"the number {text[:40]} is out of range") from None


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """The tables of a TOML text, decimals kept as written.

    Raises:
        ConfigError: not TOML; the message has the line and column.
    """
    deep = _DEEP_KEY.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        what = f"can't be read: a key of more than {_DEEPEST_KEY} parts (at line {line})"
        raise ConfigError(Problem("TOML", what), source)
    try:
        return tomllib.loads(text, parse_float=_decimal)
    except RecursionError:
        raise ConfigError(Problem("TOML", "can't be read: nested too deeply"), source) from None
    except ValueError as error:
        text = re.sub(r"\(('[^()]*'),?\)", _dotted, str(error))
        raise ConfigError(Problem("TOML", f"can't be read: {text}"), source) from None


def _long_integers(table: dict[str, Any]) -> list[Problem]:
    """Whole numbers too long to be shown; TOML has no limit for hexadecimal ones."""
    problems = []
    waiting: list[tuple[tuple[str | int, ...], Any]] = [((), table)]
    while waiting:
        path, node = waiting.pop()
        if isinstance(node, dict):
            waiting += [((*path, key), child) for key, child in node.items()]
        elif isinstance(node, list):
            waiting += [((*path, index), child) for index, child in enumerate(node)]
        elif isinstance(node, int) and node.bit_length() > messages.LONGEST_INTEGER:
            most = messages.LONGEST_INTEGER
            what = f"given {messages.shown(node)}; whole numbers of at most {most} bits are allowed"
            problems.append(Problem(messages.key_path(path), what))
    return problems


def _dotted(key: re.Match[str]) -> str:
    """tomllib shows a key as a Python tuple; the user wrote a dotted key."""
    return '"' + key[1].strip("'").replace("', '", ".") + '"'


def _apply(table: dict[str, Any], assignment: str) -> None:
    """One ``--set KEY=VALUE``: dotted key with optional [index], TOML value (a bare word is a string)."""
    key, equals, value_text = assignment.partition("=")
    where = f"--set {assignment[:60]}"
    if not equals or not key.strip() or "\n" in assignment:
        raise ConfigError(Problem(where, "write KEY=VALUE on one line, such as time.end=10"))
    if _DEEP_KEY.search(assignment):
        raise ConfigError(Problem(where, f"a key of more than {_DEEPEST_KEY} parts"))
    try:
        value = tomllib.loads(f"value = {value_text}", parse_float=_decimal)["value"]
    except (ValueError, RecursionError):
        value = value_text.strip()
    steps: list[str | int] = []
    for part in key.strip().split("."):
        match = re.fullmatch(r"([^\[\]]+)((?:\[\d{1,9}\])*)", part.strip())
        if match is None:
            raise ConfigError(
                Problem(
                    where, f'"{part}" is not a key, or a key with an index counted from 0, such as times[0]'
                )
            )
        steps.append(match[1])
        steps.extend(int(index) for index in re.findall(r"\d+", match[2]))
    target: Any = table
    for step, following in pairwise(steps):
        if isinstance(target, dict) and isinstance(step, str):
            target = target.setdefault(step, [] if isinstance(following, int) else {})
        elif isinstance(target, list) and isinstance(step, int) and 0 <= step < len(target):
            target = target[step]
        else:
            raise ConfigError(Problem(where, f'there is nothing at "{step}" to set'))
    last = steps[-1]
    try:
        if isinstance(target, list) == isinstance(last, str):
            raise TypeError
        target[last] = value
    except (TypeError, IndexError):
        raise ConfigError(Problem(where, f'there is nothing at "{last}" to set')) from None


def parse(text: str, *, source: str = "config", overrides: Sequence[str] = ()) -> Experiment:
    """Read a TOML text.

    Args:
        text: the config.
        source: its name in messages.
        overrides: ``KEY=VALUE`` texts that replace values, in order.

    Raises:
        ConfigError: with every problem found.
    """
    if len(overrides) > _MOST_OVERRIDES:
        what = f"given {len(overrides)} values to set; at most {_MOST_OVERRIDES} are allowed"
        raise ConfigError(Problem("--set", what), source)
    table = parse_toml(text, source)
    try:
        for assignment in overrides:
            _apply(table, assignment)
    except ConfigError as error:
        raise error.at(source) from None
    problems = _long_integers(table)
    if problems:
        raise ConfigError(problems, source)
    problems = messages.later_features(table)
    model = config_model()
    try:
        config = model.model_validate(table)
    except ValidationError as error:
        named = {problem.where for problem in problems}
        found = messages.config_error(model, error, {*POINT_OR_NAME, *LOAD_KINDS}).problems
        problems += [problem for problem in found if problem.where not in named]
    if problems:
        raise ConfigError(problems, source)
    if overrides:
        text = text.rstrip("\n") + "\n" + "".join(f"#:set {line.strip()}\n" for line in overrides)
    return Experiment(text, config, source)


def load(path: str | Path, *, overrides: Sequence[str] = ()) -> Experiment:
    """Read a config file; see ``parse``.

    A text that a run wrote (``config.toml`` of a run folder) carries its overrides in ``#:set`` lines and
    means the same again.

    Raises:
        ConfigError: no such file, not text, too large, or a bad config.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
        if size > _LARGEST_FILE:
            raise ConfigError(
                Problem("file", f"{size} bytes; a config has at most {_LARGEST_FILE}"), str(path)
            )
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(Problem("file", f"can't be read: {error.strerror or error}"), str(path)) from None
    except UnicodeDecodeError as error:
        raise ConfigError(
            Problem("file", f"not UTF-8 text (byte {error.start}); save it as UTF-8"), str(path)
        ) from None
    return parse_saved(text, source=str(path), overrides=overrides)


def parse_saved(text: str, *, source: str, overrides: Sequence[str] = ()) -> Experiment:
    """Read a text that may carry overrides in ``#:set`` lines, which are applied first; see ``parse``.

    Raises:
        ConfigError: with every problem found.
    """
    kept = [line[6:].strip() for line in text.splitlines() if line.startswith("#:set ")]
    body = "\n".join(line for line in text.split("\n") if not line.startswith("#:set "))
    return parse(body, source=source, overrides=[*kept, *overrides])
