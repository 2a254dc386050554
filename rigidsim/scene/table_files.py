"""Table files beside a config, taken into its text so that a run depends on no other file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.schema import Config

_LARGEST_TABLE = 3_000_000  # bytes


def table_sections(config: Config, folder: Path) -> str:
    """TOML text, to be appended to the config, with the tables that loads name and the config doesn't
    contain.

    Args:
        folder: folder to which relative names refer.

    Raises:
        ConfigError: a file can't be read, or can't be part of a TOML text.
    """
    found: dict[str, str] = {}
    for where, name in _named(config):
        if name not in found and name not in config.tables:
            found[name] = _section(name, _text(where, name, folder / name))
    return "".join(found.values())


def _named(config: Config) -> Iterator[tuple[str, str]]:
    """Tables that loads name, with the place of each name in the config."""
    for number, load in enumerate(config.loads, 1):
        name = getattr(getattr(load, "orbit", None), "table", None)
        if name is not None:
            yield f"[[loads]] number {number} orbit.table", name


def _text(where: str, name: str, path: Path) -> str:
    try:
        size = path.stat().st_size
        if size > _LARGEST_TABLE:
            what = f'given "{name}" of {size} bytes; a table has at most {_LARGEST_TABLE}: keep the rows and '
            raise ConfigError(Problem(where, what + "digits that the run needs"))
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        what = (
            f'given "{name}", which can\'t be read ({error.strerror or error}): {path} is looked for, beside '
        )
        raise ConfigError(Problem(where, what + "the config")) from None
    except (UnicodeDecodeError, ValueError):
        raise ConfigError(
            Problem(where, f'given "{name}", which is not UTF-8 text; save it as CSV')
        ) from None
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if "'''" in text or any((ord(c) < 32 and c not in "\n\t") or ord(c) == 127 for c in text):
        what = f'given "{name}", which holds characters that no table has; save it as plain CSV'
        raise ConfigError(Problem(where, what))
    return text


def _section(name: str, text: str) -> str:
    return f"\n[tables.{json.dumps(name)}]\ntext = '''\n{text.rstrip()}\n'''\n"
