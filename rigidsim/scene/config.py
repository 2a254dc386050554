"""From TOML text to a validated config, with every digit as it was written."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import ValidationError

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import validation_messages as messages
from rigidsim.scene.frame_table import PLANE_OR_NORMAL
from rigidsim.scene.overrides import apply_overrides, written
from rigidsim.scene.registry import LOAD_KINDS
from rigidsim.scene.schema import POINT_OR_NAME, Config, config_model
from rigidsim.scene.toml_text import long_integers, parse_toml

_LARGEST_FILE = 4_000_000  # bytes; a body of tens of thousands of points still fits
_EARLIER_MARK = "#:set "


@dataclass(frozen=True)
class Experiment:
    """A config as given, and its meaning.

    Attributes:
        text: the TOML text of what is run: each key has one value, where it stands in plain sight.
        config: the validated tables.
        source: where it came from, for messages.
        given: the TOML text as it was given, before any value was replaced.
        settings: the ``KEY=VALUE`` texts given beside it, in order.
    """

    text: str
    config: Config
    source: str
    given: str
    settings: tuple[str, ...] = ()

    @property
    def sha256(self) -> str:
        """Of the TOML text of what is run."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def having(self, overrides: Sequence[str]) -> Experiment:
        """The same with values replaced by the program, not by who gave it; see ``parse``.

        Raises:
            ConfigError: with every problem found.
        """
        other = parse(self.text, source=self.source, overrides=overrides)
        return replace(other, given=self.given, settings=self.settings)


def parse(text: str, *, source: str = "config", overrides: Sequence[str] = ()) -> Experiment:
    """Read a TOML text.

    Args:
        text: the config.
        source: its name in messages.
        overrides: ``KEY=VALUE`` texts that replace values, in order.

    Raises:
        ConfigError: with every problem found.
    """
    table = parse_toml(text, source)
    try:
        apply_overrides(table, overrides)
    except ConfigError as error:
        raise error.at(source) from None
    problems = long_integers(table)
    if problems:
        raise ConfigError(problems, source)
    problems = messages.later_features(table)
    model = config_model()
    try:
        config = model.model_validate(table)
    except ValidationError as error:
        named = {problem.where for problem in problems}
        found = messages.config_error(model, error, {*POINT_OR_NAME, *PLANE_OR_NORMAL, *LOAD_KINDS}).problems
        problems += [problem for problem in found if problem.where not in named]
    if problems:
        raise ConfigError(problems, source)
    run = written(text, overrides, table, source) if overrides else text
    return Experiment(run, config, source, text, tuple(line.strip() for line in overrides))


def load(path: str | Path, *, overrides: Sequence[str] = ()) -> Experiment:
    """Read a config file; see ``parse``.

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
    return parse(text, source=str(path), overrides=overrides)


def parse_earlier(text: str, *, source: str, overrides: Sequence[str] = ()) -> Experiment:
    """Read a text that the first version wrote into a run's files; see ``parse``.

    Those kept what ``--set`` had replaced in ``#:set KEY=VALUE`` comments at the end. Anywhere else, and in
    every other text, such a line is a comment like any other.

    Raises:
        ConfigError: with every problem found.
    """
    body, kept = _split_earlier(text)
    return parse(body, source=source, overrides=[*kept, *overrides])


def has_earlier_settings(text: str) -> bool:
    """Whether a text ends as those that ``parse_earlier`` is for."""
    return bool(_split_earlier(text)[1])


def _split_earlier(text: str) -> tuple[str, list[str]]:
    lines = text.rstrip("\n").split("\n")
    first = len(lines)
    while first and lines[first - 1].startswith(_EARLIER_MARK):
        first -= 1
    if first == len(lines):
        return text, []
    kept = [line.removeprefix(_EARLIER_MARK).strip() for line in lines[first:]]
    return "\n".join([*lines[:first], ""]), kept
