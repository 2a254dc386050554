"""What ``rigidsim schema`` prints: what an editor shows of each key, and what it marks as wrong."""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rigidsim.scene.schema import editor_schema


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    """As it is printed."""
    return json.loads(json.dumps(editor_schema()))


def tables(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    yield "", schema
    yield from schema["$defs"].items()


def keys(schema: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """By table and name."""
    return {f"{table}.{name}": key for table, of in tables(schema) for name, key in of["properties"].items()}


def test_every_table_and_key_says_what_it_is(schema: dict[str, Any]) -> None:
    silent = [name for name, of in tables(schema) if not of.get("description")]
    silent += [name for name, key in keys(schema).items() if not key.get("description")]
    assert silent == []


# --- an editor's own checker --------------------------------------------------------------------------------


def taplo() -> str:
    """What checks TOML files in editors; of the extra "test"."""
    beside = Path(sys.executable).with_name("taplo")
    found = str(beside) if beside.exists() else shutil.which("taplo")
    if found is None:
        pytest.skip("taplo isn't installed (pip install -e '.[test]')")
    return found


def marked(schema: dict[str, Any], folder: Path, *files: Path) -> tuple[int, str]:
    (folder / "rigidsim.schema.json").write_text(json.dumps(schema))
    command = [taplo(), "check", "--schema", f"file://{folder}/rigidsim.schema.json", *map(str, files)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ('"cuboid"', '"cubid"', '"cubid" is not one of'),
        ("angular_velocity", "angular_velocty", "angular_velocty"),
        ("[0, 2, 1e-3]", '[0, "fast", 1e-3]', "fast"),
        ('"double"', '"doble"', "doble"),
        ('"double"', '15\n[[loads]]\nkind = "gravity"', "gravity"),
    ],
)
def test_mistakes_are_marked(
    right: str, wrong: str, said: str, schema: dict[str, Any], tmp_path: Path
) -> None:
    text = SCENE.replace(right, wrong)
    assert text != SCENE
    (tmp_path / "scene.toml").write_text(text)
    code, found = marked(schema, tmp_path, tmp_path / "scene.toml")
    assert code != 0
    assert said in found


SCENE = """
name = "book"
[body]
shape = "cuboid"
mass = 12
size = [4, "300 cm", 2]
[initial]
angular_velocity = [0, 2, 1e-3]
[time]
end = 120
samples = 11
[integrator]
precision = "double"
"""
