"""``run --sweep KEY=SPEC``: axes given with the command."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.config import Experiment
from rigidsim.scene.validation_messages import shown

_CALL = re.compile(r"(linspace|logspace|step|uniform|normal|sphere)\s*\((.*)\)")
_SPECS = (
    "[1, 2, 4], linspace(from, to, count), logspace(from, to, count), step(from, step, count), "
    "uniform(from, to, count), normal(mean, deviation, count), sphere(radius, count), or a table such as "
    '{values = [1, 2], name = "a"}'
)


def scanned(experiment: Experiment, scan: Sequence[str]) -> Experiment:
    """An experiment with additional sweep axes.

    Args:
        scan: ``KEY=SPEC`` texts: a TOML array of values, a call such as ``linspace(from, to, count)`` (see
            the error's text), or a TOML table as ``[sweep] axes`` has it.

    Raises:
        ConfigError: a text can't be read.
    """
    settings = []
    for text in scan:
        key, equals, spec = (part.strip() for part in text.partition("="))
        if not equals or not key or not spec:
            what = "write KEY=SPEC, such as time.end=[1, 2, 4] or body.mass=linspace(0, 1, 11)"
            raise ConfigError(Problem(f"--sweep {text[:60]}", what))
        table = _table(spec)
        try:
            understood = isinstance(tomllib.loads(f"table = {table}")["table"], dict)
        except (ValueError, RecursionError):
            understood = False
        if not understood:
            raise ConfigError(Problem(f"--sweep {text[:60]}", f"given {shown(spec)}; allowed: {_SPECS}"))
        settings.append(f'sweep.axes."{key}"={table}')
    return experiment.having(settings)


def _table(spec: str) -> str:
    """The axis's table in TOML, if the text is understood."""
    call = _CALL.fullmatch(spec)
    if call is None:
        return f"{{values = {spec}}}" if spec.startswith("[") else spec
    way, inside = call[1], call[2]
    if way in ("uniform", "normal", "sphere"):
        ends, _, count = inside.rpartition(",")
        return f"{{{way} = {ends if way == 'sphere' else f'[{ends}]'}, count = {count}}}"
    return f"{{{way} = [{inside}]}}"
