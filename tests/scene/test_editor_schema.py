"""What ``rigidsim schema`` prints: what an editor shows of each key, and what it marks as wrong."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rigidsim.scene.bodies.presets import PRESETS
from rigidsim.scene.editor_schema import editor_schema
from rigidsim.scene.registry import LOAD_KINDS, OBSERVABLES

ROOT = Path(__file__).parents[2]
READY = [*ROOT.glob("configs/**/*.toml")]


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


def test_numbers_name_their_units(schema: dict[str, Any]) -> None:
    found = keys(schema)
    assert found["Initial.angular_velocity"]["description"].endswith("[rad/s]")
    assert found["Body.inertia_tensor"]["x-unit"] == "kg m^2"
    assert found[".parameters"]["description"].endswith("[SI, or any unit]")
    named = {name: key["x-unit"] for name, key in found.items() if key.get("x-unit") not in (None, "1", "")}
    assert len(named) > 40
    assert [
        name for name, unit in named.items() if not found[name]["description"].endswith(f"[{unit}]")
    ] == []


def test_defaults_are_as_one_would_write_them(schema: dict[str, Any]) -> None:
    found = keys(schema)
    defaults = {name: key["default"] for name, key in found.items() if "default" in key}
    assert defaults["Time.start"] == 0
    assert defaults["UniformGravityFields.acceleration"] == [0, 0, -9.80665]
    assert defaults["Integrator.tolerance"] == "auto"
    assert None not in defaults.values()  # TOML has no null
    assert not any(isinstance(value, dict) for value in defaults.values())


def test_fixed_values_are_enumerated(schema: dict[str, Any]) -> None:
    found = keys(schema)
    assert found["Body.preset"]["enum"] == list(PRESETS)
    assert found["Output.record"]["items"]["anyOf"][0]["enum"] == list(OBSERVABLES)
    assert len(found["Integrator.euler_sequence"]["enum"]) == 12
    kinds = {
        table["properties"]["kind"]["const"] for _, table in tables(schema) if "kind" in table["properties"]
    }
    assert kinds == set(LOAD_KINDS)


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


def test_ready_configs_are_right_for_an_editor(schema: dict[str, Any], tmp_path: Path) -> None:
    code, said = marked(schema, tmp_path, *READY)
    assert len(READY) > 30
    assert code == 0, said


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ('"cuboid"', '"cubid"', '"cubid" is not one of'),
        ("angular_velocity", "angular_velocty", "angular_velocty"),
        ("[0, 2, 1e-3]", "[0, 2]", "has less than 3 items"),
        ("[0, 2, 1e-3]", '[0, "fast", 1e-3]', "fast"),
        ("end = 120", "end = 120\nprecision = 3", "precision"),
        ('"double"', '"doble"', "doble"),
        ('"double"', "251", "251"),
        ('"double"', "15\ntolerance = 2", "2"),
        ('"double"', '15\neuler_sequence = "zzx"', "zzx"),
        ('"double"', '15\n[output]\nrecord = ["quaternions"]', "quaternions"),
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
