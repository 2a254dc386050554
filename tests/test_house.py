"""docs/house.md lists the rooms."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "house.md").read_text(encoding="utf-8")


def test_each_room_is_in_the_table() -> None:
    rooms = {path.parent.name for path in (ROOT / "rigidsim").glob("*/__init__.py")}
    table = PAGE.split("## The way of a run")[0]
    assert set(re.findall(r"`(\w+)/`", table.split("| room |")[1])) == rooms
