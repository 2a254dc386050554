"""docs/house.md tells the truth: which rooms there are, how long modules are, and which way a run takes."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from types import FrameType

from house_figures import FORMULATION, LONGEST, ROOT, SOLVER, late_imports, length, of_folder, package
from typer.testing import CliRunner

from rigidsim.cli.app import app

PAGE = (ROOT / "docs" / "house.md").read_text(encoding="utf-8")
MODULES = package(of_folder(ROOT))


def test_each_room_is_in_the_table() -> None:
    rooms = {path.parent.name for path in (ROOT / "rigidsim").glob("*/__init__.py")}
    table = PAGE.split("## The way of a run")[0]
    assert set(re.findall(r"`(\w+)/`", table.split("| room |")[1])) == rooms
    # the package's face, the program, what a user can be told, and the mark that it has types
    face = {path.name for path in (ROOT / "rigidsim").iterdir() if path.is_file()}
    assert face == {"__init__.py", "__main__.py", "errors.py", "py.typed"}


def test_no_module_is_longer_than_the_page_says() -> None:
    assert f"at most {LONGEST} lines" in PAGE
    assert [path for path, code in MODULES.items() if length(code) > LONGEST] == []


def test_hardly_any_module_asks_which_solver_it_is() -> None:
    """They ask ``rigidsim.scene.choices`` what a method can do; what is left are names promised to users."""
    assert len(SOLVER.named_in(MODULES)) <= 8
    found = SOLVER.asked_in(
        {"a.py": 'if m in ("taylor", "b"): c', "b.py": "d.closed", "c.py": 'e = "taylor"'}
    )
    assert found == ["a.py", "b.py"]


def test_hardly_any_module_asks_which_formulation_it_is() -> None:
    """They ask ``rigidsim.model.formulations`` what it can do."""
    assert len(FORMULATION.asked_in(MODULES)) <= 15


def test_imports_within_functions_are_counted_once() -> None:
    assert late_imports("import a\ndef f():\n    import b\n    def g():\n        from c import d") == 2


def test_no_class_name_has_two_meanings() -> None:
    found: dict[str, list[str]] = {}
    for path, code in MODULES.items():
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name.lstrip("_"), []).append(path)
    assert len(found) > 300
    assert {name: places for name, places in found.items() if len(places) > 1} == {}


def patched(code: str) -> list[str]:
    """Private names and constants of others that a module sets: by ``setattr``, by a patch, or plainly."""
    found: list[str] = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
            found += [] if own else [node.attr]
        elif isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            if re.search(r"(setattr|delattr|patch|patch\.object|patch\.multiple)$", called):
                found += [x.value for x in node.args[:2] if isinstance(x, ast.Constant) and str(x.value)]
                found += [keyword.arg or "" for keyword in node.keywords]
    names = (str(name).rpartition(".")[2] for name in found)
    return [name for name in names if re.fullmatch(r"_(?!_)\w+|[A-Z][A-Z\d_]*", name)]


def test_no_test_and_no_study_patches_what_is_private_or_constant() -> None:
    """Tunables are arguments: what a test sets is what a user of the module could set as well."""
    assert patched('m.setattr(charts, "NEAR", 0)\nm.setattr("a.b._c", 0)\nm.setattr(os, "replace", f)') == [
        "NEAR",
        "_c",
    ]
    assert patched("with mock.patch.multiple(A, _b=0, c=0): motion.LONG = 1\nself._d = 2") == ["_b", "LONG"]
    folders = [ROOT / name for name in ("tests", "experiments", "docs")]
    codes = {path: path.read_text(encoding="utf-8") for folder in folders for path in folder.rglob("*.py")}
    codes.pop(ROOT / "experiments" / "peers" / "rebound_bs.py")  # which fills another library's structure in
    assert {path: names for path, code in codes.items() if (names := patched(code))} == {}


def test_a_run_takes_the_way_that_the_page_tells(tmp_path: Path) -> None:
    section = PAGE.split("## The way of a run")[1].split("\n## ")[0]
    told = re.findall(r"^\d+\. `([\w/]+\.py)`, `(\w+)`", section, flags=re.MULTILINE)
    assert len(told) == len(re.findall(r"^\d+\. ", section, flags=re.MULTILINE)) > 10
    met: dict[tuple[str, str], None] = {}

    def noted(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(str(ROOT / "rigidsim")):
            met.setdefault((Path(code.co_filename).relative_to(ROOT).as_posix(), code.co_name))

    config = ROOT / "configs" / "intermediate_axis.toml"
    short = ["--set", "time.samples=11", "--set", "output.timeline=false", "--out", str(tmp_path)]
    sys.setprofile(noted)
    try:
        done = CliRunner().invoke(app, ["run", str(config), *short])
    finally:
        sys.setprofile(None)
    assert done.exit_code == 0, done.output
    assert [place for place in met if place in set(told)] == told
