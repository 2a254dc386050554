"""Names that version 1.0 promises for all of 1.x (docs/versions.md) are still there, and mean the same.

``python tests/test_promises.py`` writes those of today: only when some have been added.
"""

import inspect
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import typer

import rigidsim
import rigidsim.workflows.read  # everything is registered
from rigidsim.cli.app import app
from rigidsim.scene.cautions import WarningCode
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.schema import editor_schema
from rigidsim.solve.status import Status
from rigidsim.store.variables import LABELS

FILE = Path(__file__).parent / "data" / "promised.json"
SCENE = """
name = "free"
body.principal_moments = [1, 2, 3]
initial.angular_velocity = [0.1, 1, 0]
time = {end = 1, samples = 3}
"""


def configs() -> dict[str, Any]:
    """Unit, default and allowed words of each key of each table."""
    schema = editor_schema()
    told = ("x-unit", "default", "enum", "const")
    return {
        title: {
            key: {word: content[word] for word in told if word in content}
            for key, content in table["properties"].items()
        }
        for title, table in {"": schema, **schema["$defs"]}.items()
    }


def commands() -> dict[str, Any]:
    """Arguments and options of each command."""
    group: Any = typer.main.get_command(app)
    return {
        name: {parameter.name: sorted(parameter.opts) for parameter in command.params}
        for name, command in group.commands.items()
    }


def datasets() -> dict[str, Any]:
    """Dimensions, unit and frame of each variable, and labels of each coordinate."""
    variables = {n: [list(o.dims), o.units, o.frame] for n, o in OBSERVABLES.items()}
    return {"variables": variables, "labels": {name: list(labels) for name, labels in LABELS.items()}}


def summaries() -> dict[str, Any]:
    """Keys of a run's summary and of its plan, exit codes of statuses, and codes of warnings."""
    scene = rigidsim.parse(SCENE)
    return {
        "keys": keys(rigidsim.run(scene, out=None).summary),
        "plan": keys(rigidsim.plan(scene).as_dict()),
        "statuses": {status.value: status.exit_code for status in Status},
        "warnings": {code.value: None for code in WarningCode},
    }


def keys(table: Mapping[str, Any]) -> dict[str, Any]:
    """With those of the tables in it."""
    return {key: sorted(value) if isinstance(value, Mapping) else None for key, value in table.items()}


def python() -> dict[str, Any]:
    """What is public, with the names of arguments of functions."""
    public = {name: getattr(rigidsim, name) for name in rigidsim.__all__}
    return {
        name: list(inspect.signature(one).parameters) if inspect.isfunction(one) else None
        for name, one in public.items()
    }


PARTS = (configs, commands, datasets, summaries, python)


def broken(promised: Any, found: Any, place: str = "") -> list[str]:
    """Where what was promised isn't found: names may be added, also to lists, but none goes or changes."""
    if isinstance(promised, Mapping) and isinstance(found, Mapping):
        gone = [f"{place}.{key}: is gone" for key in promised if key not in found]
        kept = [key for key in promised if key in found]
        return gone + [fault for k in kept for fault in broken(promised[k], found[k], f"{place}.{k}")]
    if isinstance(promised, list) and isinstance(found, list):
        return [f"{place}: {one!r} is gone" for one in promised if one not in found]
    return [] if promised == found else [f"{place}: {found!r} instead of {promised!r}"]


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.__name__)
def test_what_is_promised_is_kept(part: Any) -> None:
    promised = json.loads(FILE.read_text())[part.__name__]
    assert broken(promised, json.loads(json.dumps(part()))) == []


if __name__ == "__main__":
    today = {part.__name__: part() for part in PARTS}
    if FILE.exists() and (faults := broken(json.loads(FILE.read_text()), json.loads(json.dumps(today)))):
        sys.exit("\n".join(["these are promised for all of 1.x:", *faults]))
    FILE.write_text(json.dumps(today, indent=1) + "\n")
