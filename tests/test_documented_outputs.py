"""Outputs that the documentation shows are those of the code.

Above a shown output stands a marker, ``<!-- output: COMMAND -->`` (or ``slow output``, compared by hand).
A fenced block below it is all that the command prints on stdout, a table below it the command's table, row by
row.
``python tests/test_documented_outputs.py [FILE...]`` writes them anew: when numbers are meant to move.

They agree in every word, and number by number:

- times in lines that begin with ``cost`` or ``CPU`` are of the machine that wrote them, and aren't compared;
- whole numbers, and numbers given to fewer than 4 digits, are the same; but from 1000 on one in a thousand is
  allowed (steps follow from last bits, which depend on the CPU);
- what is written with an exponent is an error or a bound: the same order of magnitude (a factor of 10: errors
  are made of last bits); below 1e-13 it is rounding, whatever its size;
- other numbers agree to one part in 1e9, or to one in their last digit;
- the share in a verdict ("1.8 % of it at most") is made of last bits, and isn't compared;
- in tables of checks the columns "measured" and "error" aren't compared (some are of chaotic motions, which
  no two CPUs share): each row holds them to what is expected and allowed, and its verdict is compared.
"""

import math
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "experiments").glob("*.md")),
]
_BLOCK = r"(```\n.*?^```$|(?:\|[^\n]*\n)+)"
_MARKER = re.compile(rf"<!-- (?:(slow) )?output: (.+?) -->\n+{_BLOCK}", re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.]*\w)")
_TIME = re.compile(r"(?<![\w.])\d[\d.]* (?:ns|us|ms|s|min|h)\b")
_ROUNDING = 1e-13
_MARKS = {"": (), "slow": pytest.mark.campaign}


@dataclass(frozen=True)
class Shown:
    """An output as it is shown.

    Attributes:
        stage: "slow" or "", as in the marker.
        span: of its lines in the page's text.
    """

    page: Path
    stage: str
    command: str
    text: str
    span: tuple[int, int]

    @property
    def table(self) -> bool:
        return self.text.startswith("|")

    def made(self, folder: Path) -> str:
        """What the code prints now, with a repository's configs at hand."""
        (folder / "configs").symlink_to(ROOT / "configs")
        words = self.command.split()
        program = {"rigidsim": ["-m", "rigidsim"], "python": []}[words[0]]
        done = subprocess.run(
            [sys.executable, *program, *words[1:]],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "110"},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        lines = [line.rstrip() for line in done.stdout.splitlines()]
        if self.table:
            return "".join(f"{line}\n" for line in lines if line.startswith("|"))
        return "```\n" + "".join(f"{line}\n" for line in lines) + "```"


def shown_in(page: Path) -> list[Shown]:
    """All marked outputs of a page."""
    text = page.read_text(encoding="utf-8")
    found = _MARKER.finditer(text)
    return [Shown(page, match[1] or "", match[2], match[3], match.span(3)) for match in found]


OUTPUTS = [shown for page in PAGES for shown in shown_in(page)]


def differences(shown: str, made: str) -> list[str]:
    """Lines that don't agree, by the rules above."""
    one, other = ([_plain(line) for line in _compared(text)] for text in (shown, made))
    found = [f"{a!r} is shown, {b!r} is printed" for a, b in zip(one, other, strict=False) if not agree(a, b)]
    return found + [f"{line!r} is on one side alone" for line in (one[len(other) :] or other[len(one) :])]


def _compared(text: str) -> list[str]:
    """The lines of an output, unbroken, without the columns that checks hold by themselves."""
    lines = re.sub(r"(?<=\S)\n {9}(?=\S)", " ", text).splitlines()
    names = [name.strip() for name in lines[0].split("|")] if lines else []
    held = [n for n, name in enumerate(names) if name in ("measured", "error") and "allowed" in names]
    if not held:
        return lines
    rows = [line.split("|") for line in lines]
    return ["|".join("..." if n in held else cell for n, cell in enumerate(row)) for row in rows]


def _plain(line: str) -> str:
    line = re.sub(r"─+", "─", " ".join(line.split()))
    line = re.sub(r"[\d.]+ % of it at most", "SHARE of it at most", line)
    return _TIME.sub("TIME", line) if line.startswith(("cost ", "CPU ")) else line


def agree(one: str, other: str) -> bool:
    """Whether two lines have the same words and numbers."""
    if _NUMBER.sub("#", one) != _NUMBER.sub("#", other):
        return False
    return all(map(close, _NUMBER.findall(one), _NUMBER.findall(other)))


def close(one: str, other: str) -> bool:
    """Whether two numbers agree, as they are written."""
    if one == other:
        return True
    a, b = (float(text.replace(",", "")) for text in (one, other))
    exponents = "e" in one.lower() and "e" in other.lower()
    if exponents or not min(abs(a), abs(b)):
        if max(abs(a), abs(b)) < _ROUNDING:
            return True
        return a * b > 0 and abs(math.log10(a / b)) <= 1
    digits = [Decimal(text.replace(",", "")).as_tuple() for text in (one, other)]
    if all(found.exponent == 0 for found in digits):
        return min(abs(a), abs(b)) >= 1000 and abs(a - b) <= abs(a) / 1000
    if any(len(found.digits) < 4 for found in digits):
        return False
    last = 10.0 ** max(int(found.exponent) for found in digits)
    return abs(a - b) <= max(1.000001 * last, 1e-9 * abs(a))


@pytest.mark.parametrize(
    "shown",
    [
        pytest.param(shown, id=f"{shown.page.name}: {shown.command}", marks=_MARKS[shown.stage])
        for shown in OUTPUTS
        if shown.stage in _MARKS
    ],
)
def test_what_is_shown_is_what_is_printed(shown: Shown, tmp_path: Path) -> None:
    found = differences(shown.text, shown.made(tmp_path))
    where = f"{shown.page.relative_to(ROOT)}, {shown.command}"
    assert not found, "\n".join([f"{where} (to write it anew: python {__file__})", *found])


def test_every_marker_has_its_output() -> None:
    markers = sum(len(re.findall(r"<!--.*output", page.read_text(encoding="utf-8"))) for page in PAGES)
    assert markers == len(OUTPUTS) >= 3
    assert {shown.stage for shown in OUTPUTS} == {"", "slow"}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_what_a_page_names_is_there(page: Path) -> None:
    """Files, modules and links."""
    text = page.read_text(encoding="utf-8")
    rooms = "tests|experiments|rigidsim|configs|docs"
    paths = [ROOT / name for name in re.findall(rf"`((?:{rooms})/[\w/.-]+)`", text)]
    found = re.findall(r"python -m ([a-z_]+(?:\.[a-z_]+)+)", text)
    modules = [ROOT / name.replace(".", "/") for name in found]
    plain = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    links = [
        page.parent / name for name in re.findall(r"\]\(([^)#\s]+)[^)\s]*\)", plain) if "://" not in name
    ]
    assert [path for path in paths + links if not path.exists()] == []
    assert [module for module in modules if not module.with_suffix(".py").exists()] == []


def main(names: list[str]) -> None:
    """Write the outputs of some pages, or all, anew."""
    for page in [Path(name).resolve() for name in names] or PAGES:
        for shown in reversed(shown_in(page)):
            print(f"{page.name}: {shown.command}", flush=True)
            with tempfile.TemporaryDirectory() as folder:
                made = shown.made(Path(folder))
            text = page.read_text(encoding="utf-8")
            page.write_text(text[: shown.span[0]] + made + text[shown.span[1] :], encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
