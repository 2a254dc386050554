"""Would the tests notice a small mistake? Puts one at a time into a copy of the package, and runs the tests.

Mistakes are drawn at random, over rooms and kinds: a sign, a product for a quotient, a comparison, an index
off by one, a factor, min for max, a matrix untransposed, a frame. Messages, docstrings and annotations are
spared. Tests that execute the changed line run, the cheapest first, and the first that fails catches the
mistake. Which tests execute which line is measured once (``pip install coverage pytest-cov``), and kept in
coverage's own file; the tests' seconds are in FILE.xml. Commits are tried, in copies made by git.

Run: python -m experiments.mutations [--count N] [--seed S] [--seconds T] [--long] [--lines FILE]
"""

import ast
import io
import os
import random
import re
import subprocess
import sys
import tarfile
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from coverage import CoverageData

from experiments.common import Command

ROOT = Path(__file__).parents[1]
OPERATORS: dict[type, type] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip
NAMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "sin": "cos", "cos": "sin"}
DROPPED = ("transpose", "transposed", "conjugated", "conjugate", "normalised", "abs")
"""Functions of which a mistake gives the argument back."""
SPARED = (ast.Raise, ast.JoinedStr, ast.Import, ast.ImportFrom, ast.Assert)
WORDS = re.compile(r"(Problem|Error|Warning|Caution|print|text|words|warn)$")
"""Calls that make messages."""


@dataclass(frozen=True)
class Mutant:
    """A mistake: the lines of a file before and after."""

    path: str
    line: int
    kind: str
    before: str
    after: str
    old: str
    new: str


def changed(node: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    """What a node may be by mistake."""
    if isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in OPERATORS:
        other = deepcopy(node)
        other.op = OPERATORS[type(node.op)]()
        yield type(node.op).__name__, other
    elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in OPERATORS:
        yield "comparison", ast.Compare(node.left, [OPERATORS[type(node.ops[0])]()], node.comparators)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
        yield "sign" if isinstance(node.op, ast.USub) else "not", node.operand
    elif isinstance(node, ast.Attribute) and node.attr == "T":
        yield "transposed", node.value
    elif isinstance(node, ast.Call):
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        if name in NAMES:
            other = deepcopy(node)
            setattr(other.func, "attr" if isinstance(node.func, ast.Attribute) else "id", NAMES[name])
            yield name, other
        elif name in DROPPED and len(node.args) == 1 and not node.keywords:
            yield name, node.args[0]
    elif isinstance(node, ast.Constant) and type(node.value) is int and abs(node.value) < 10:
        yield "off by one", ast.Constant(node.value + 1)
    elif isinstance(node, ast.Constant) and type(node.value) is float and node.value:
        yield "factor", ast.Constant(node.value * 2)


def reachable(node: ast.AST) -> Iterator[ast.expr]:
    """Expressions below a node that tests could notice."""
    for name, field in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_params"):
            continue
        for child in field if isinstance(field, list) else [field]:
            if not isinstance(child, ast.AST) or isinstance(child, SPARED):
                continue
            if isinstance(child, ast.Call) and WORDS.search(ast.unparse(child.func)):
                continue
            if isinstance(child, ast.expr):
                yield child
            yield from reachable(child)


def mutants(tree: Path) -> dict[str, list[Mutant]]:
    """All mistakes of each room."""
    found: dict[str, list[Mutant]] = defaultdict(list)
    for file in sorted((tree / "rigidsim").glob("*/**/*.py")):
        text, path = file.read_text(), str(file.relative_to(tree))
        lines = text.encode().splitlines(keepends=True)
        for node in reachable(ast.parse(text)):
            for kind, other in changed(node):
                whole = lines[node.lineno - 1 : node.end_lineno]
                old, after = b"".join(whole), f"({ast.unparse(other)})"
                end = len(old) - len(whole[-1]) + node.end_col_offset
                new = old[: node.col_offset] + after.encode() + old[end:]
                made = Mutant(path, node.lineno, kind, ast.unparse(node), after, old.decode(), new.decode())
                found[path.split("/")[1]].append(made)
    return found


def drawn(tree: Path, count: int, seed: int) -> list[Mutant]:
    """Mistakes from one room after the other, of kinds drawn at random."""
    every, generator, found = mutants(tree), random.Random(seed), list[Mutant]()
    rooms = sorted(every)
    generator.shuffle(rooms)
    while len(found) < count:
        room = every[rooms[len(found) % len(rooms)]]
        kind = generator.choice(sorted({mutant.kind for mutant in room}))
        mutant = generator.choice([mutant for mutant in room if mutant.kind == kind])
        with suppress(SyntaxError):  # where no other expression may be, as in a pattern
            ast.parse(exchanged((tree / mutant.path).read_text(), mutant))
            found.append(mutant)
    return found


def exchanged(text: str, mutant: Mutant) -> str:
    """The text of a file with a mistake; empty if it lacks its lines."""
    place = len("".join(text.splitlines(keepends=True)[: mutant.line - 1]))
    if not text.startswith(mutant.old, place):  # of another commit
        place = text.find(mutant.old)
    return text[:place] + mutant.new + text[place + len(mutant.old) :] if place >= 0 else ""


class Executed:
    """Which tests execute which lines, and how long each takes, as measured by ``measure``."""

    def __init__(self, path: Path) -> None:
        self._lines = CoverageData(str(path))
        self._lines.read()
        every = ElementTree.parse(f"{path}.xml").iter("testcase")
        spent = ((f"{one.get('classname')}.{one.get('name')}", one.get("time", "0")) for one in every)
        self._seconds = {test: float(seconds) for test, seconds in spent}

    def tests(self, mutant: Mutant) -> list[str]:
        """Tests that execute a line, the cheapest first; those of the whole file for a line of its import."""
        files = self._lines.measured_files()
        name = next((file for file in files if file.endswith(f"/{mutant.path}")), "")
        lines = self._lines.contexts_by_lineno(name)
        found = set(lines.get(mutant.line, [])) - {""} or set().union(*lines.values()) - {""}
        return sorted({context.rpartition("|")[0] for context in found}, key=self._spent)

    def _spent(self, test: str) -> float:
        """Seconds; JUnit's files have dots between the parts of a test's name."""
        place, bracket, parameters = test.partition("[")
        dotted = place.replace(".py::", ".").replace("::", ".").replace("/", ".")
        return self._seconds.get(dotted + bracket + parameters, 0.0)


PYTEST = [sys.executable, "-m", "pytest", "-q"]


def measure(tree: Path, path: Path, long: bool) -> None:
    """Write the files of executed lines and of seconds; the suite takes half as long again as alone."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "COVERAGE_FILE": str(path)}
    measured = ["--cov=rigidsim", "--cov-context=test", "--cov-report=", f"--junitxml={path}.xml"]
    command = [*PYTEST, "-n", "2", *measured, "-m", f"{'' if long else 'not slow and '}not campaign"]
    subprocess.run(command, cwd=tree, env=environment, check=False)


def failing(tree: Path, tests: Sequence[str], seconds: float) -> str:
    """The first test that fails; empty if none does, "time limit" if they take longer."""
    names = tree / "tests.txt"
    names.write_text("".join(f"{name}\n" for name in tests))
    command = [*PYTEST, "-x", "-p", "no:cacheprovider", "--tb=no", "-m", "", f"@{names}"]
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    try:
        done = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, timeout=seconds, check=False
        )
    except subprocess.TimeoutExpired:
        return "time limit"
    found = re.search(r"^(?:FAILED|ERROR) (\S.*?)(?: - .*)?$", done.stdout, re.MULTILINE)
    return found[1] if found else "" if done.returncode == 0 else f"exit code {done.returncode}"


def tried(tree: Path, mutant: Mutant, executed: Executed, seconds: float) -> str:
    """What catches a mistake in a tree, which is put right again."""
    file, tests, spared = tree / mutant.path, executed.tests(mutant), list[str]()
    if not tests:
        return "not executed"
    right = file.read_text()
    while True:
        file.write_text(exchanged(right, mutant))
        found = failing(tree, [name for name in tests if name not in spared], seconds)
        file.write_text(right)
        if "::" not in found or not failing(tree, [found], seconds):
            return found or "survived"
        spared.append(found)  # it fails without the mistake, too


def unpacked(ref: str, folder: Path) -> Path:
    """The tree of a commit."""
    content = subprocess.run(["git", "archive", ref], cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(content)) as archive:
        archive.extractall(folder, filter="data")
    return folder


@Command
def campaign(
    count: int = 60,
    seed: int = 1,
    seconds: float = 1200.0,
    long: bool = False,
    ref: str = "HEAD",
    lines: str = "",
    out: str = "mutations.tsv",
) -> int:
    """Try mistakes, and write a table of what caught them.

    Args:
        seconds: time limit of each run of the tests.
        long: measure the long tests, too.
        ref: the commit that is tried.
        lines: which tests execute which lines; measured if it isn't there.
    """
    with tempfile.TemporaryDirectory() as folder:
        tree = unpacked(ref, Path(folder))
        kept = Path(lines or tree / "lines").absolute()
        if not kept.exists():
            measure(tree, kept, long)
        executed = Executed(kept)
        with open(out, "w") as table:
            for mutant in drawn(tree, count, seed):
                found = tried(tree, mutant, executed, seconds)
                place = f"{mutant.path}:{mutant.line}"
                row = "\t".join([place, mutant.kind, mutant.before, mutant.after, found]).replace("\n", " ")
                print(row, file=table, flush=True)
                print(row, flush=True)
    return 0
