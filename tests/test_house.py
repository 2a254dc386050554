"""docs/house.md lists the rooms; tests and studies patch nothing private."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "house.md").read_text(encoding="utf-8")


def test_each_room_is_in_the_table() -> None:
    rooms = {path.parent.name for path in (ROOT / "rigidsim").glob("*/__init__.py")}
    table = PAGE.split("## The way of a run")[0]
    assert set(re.findall(r"`(\w+)/`", table.split("| room |")[1])) == rooms


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
    assert patched('m.setattr(charts, "NEAR", 0)\nm.setattr("a.b._c", 0)\nmotion.LONG = 1') == [
        "NEAR",
        "_c",
        "LONG",
    ]
    folders = [ROOT / name for name in ("tests", "experiments", "docs")]
    codes = {path: path.read_text(encoding="utf-8") for folder in folders for path in folder.rglob("*.py")}
    assert {path: names for path, code in codes.items() if (names := patched(code))} == {}
