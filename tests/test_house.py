"""docs/house.md tells the truth: which rooms there are, how long modules are, and which way a run takes."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import FrameType

from typer.testing import CliRunner

from rigidsim.cli.app import app

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "house.md").read_text(encoding="utf-8")
MODULES = sorted((ROOT / "rigidsim").rglob("*.py"))
LONGEST = 350


def test_each_room_is_in_the_table() -> None:
    rooms = {path.parent.name for path in (ROOT / "rigidsim").glob("*/__init__.py")}
    table = PAGE.split("## The way of a run")[0]
    assert set(re.findall(r"`(\w+)/`", table.split("| room |")[1])) == rooms
    # the package's face, the program, what a user can be told, and the mark that it has types
    face = {path.name for path in (ROOT / "rigidsim").iterdir() if path.is_file()}
    assert face == {"__init__.py", "__main__.py", "errors.py", "py.typed"}


def test_no_module_is_longer_than_the_page_says() -> None:
    assert f"at most {LONGEST} lines" in PAGE
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES}
    assert {path: length for path, length in lengths.items() if length > LONGEST} == {}


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
