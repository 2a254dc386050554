"""Would the tests notice a small mistake? Puts one at a time into a copy of the package, and runs the tests.

Mistakes are drawn at random, over rooms and kinds: a sign, a product for a quotient, a comparison, an index
off by one, a factor, min for max, a matrix untransposed, a frame. Messages, docstrings and annotations are
spared. Test files that import the changed module run first; the first test that fails catches the mistake.
What is committed is tried, in copies made by git. A mistake that no test catches takes a run of the suite.

Run: python -m experiments.mutations [--count N] [--seed S] [--seconds T] [--long] [--against REF]
"""

import argparse
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
NO_TESTS = ("test_house.py", "test_site.py", "test_config_comments.py")  # of style


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

    @property
    def room(self) -> str:
        """The room of the package that it is in."""
        return self.path.split("/")[1]


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
                assert node.end_lineno is not None
                assert node.end_col_offset is not None
                whole = lines[node.lineno - 1 : node.end_lineno]
                old, after = b"".join(whole), f"({ast.unparse(other)})"
                end = len(old) - len(whole[-1]) + node.end_col_offset
                new = old[: node.col_offset] + after.encode() + old[end:]
                made = Mutant(path, node.lineno, kind, ast.unparse(node), after, old.decode(), new.decode())
                found[made.room].append(made)
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


def ordered(tree: Path, mutant: Mutant) -> list[list[str]]:
    """Test files in groups: those that import the module, those of its room, all others."""
    module = mutant.path.removesuffix(".py").replace("/", ".")
    groups: list[list[str]] = [[], [], []]
    for path in sorted((tree / "tests").rglob("test_*.py")):
        place = 0 if module in path.read_text() else 1 if path.parent.name == mutant.room else 2
        if path.name not in NO_TESTS:
            groups[place].append(str(path.relative_to(tree)))
    return [group for group in groups if group]


def failing(tree: Path, tests: Sequence[str], seconds: float, long: bool, spared: Sequence[str] = ()) -> str:
    """The first test that fails; empty if none does, "time limit" if they take longer."""
    options = ["-x", "-q", "-p", "no:cacheprovider", "--tb=no", *(f"--deselect={name}" for name in spared)]
    options += ["-m", ""] if long else []
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    command = [sys.executable, "-m", "pytest", *options, *tests]
    try:
        done = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, timeout=seconds, check=False
        )
    except subprocess.TimeoutExpired:
        return "time limit"
    found = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return found[1] if found else "" if done.returncode == 0 else f"exit code {done.returncode}"


def tried(tree: Path, mutant: Mutant, seconds: float, long: bool) -> str:
    """What catches a mistake in a tree, which is put right again; "not there" if the tree lacks its lines."""
    file = tree / mutant.path
    right = file.read_text() if file.exists() else ""
    wrong = exchanged(right, mutant)
    if not wrong:
        return "not there"
    groups, spared = ordered(tree, mutant), list[str]()
    while groups:
        file.write_text(wrong)
        found = failing(tree, groups[0], seconds, long, spared)
        file.write_text(right)
        if not found:
            groups.pop(0)
        elif "::" not in found or not failing(tree, [found], seconds, long=True):
            return found
        else:  # it fails without the mistake, too
            spared.append(found)
    return "survived"


def unpacked(ref: str, folder: Path) -> Path:
    """The tree of a commit."""
    content = subprocess.run(["git", "archive", ref], cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(content)) as archive:
        archive.extractall(folder, filter="data")
    return folder


def main() -> None:
    """Try mistakes, and write a table of what caught them."""
    parser = argparse.ArgumentParser(prog="python -m experiments.mutations")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=1200.0, help="time limit of each run of the tests")
    parser.add_argument("--long", action="store_true", help="the long tests, too")
    parser.add_argument("--against", metavar="REF", help="try survivors with the tests of another commit")
    parser.add_argument("--out", type=Path, default=Path("mutations.tsv"))
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as here, tempfile.TemporaryDirectory() as there:
        tree = unpacked("HEAD", Path(here))
        other = None if given.against is None else unpacked(given.against, Path(there))
        with given.out.open("w") as out:
            for mutant in drawn(tree, given.count, given.seed):
                found = [tried(tree, mutant, given.seconds, given.long)]
                if other is not None and found == ["survived"]:
                    found.append(tried(other, mutant, given.seconds, given.long))
                place = f"{mutant.path}:{mutant.line}"
                row = "\t".join([place, mutant.kind, mutant.before, mutant.after, *found])
                print(row.replace("\n", " "), file=out, flush=True)
                print(row.replace("\n", " "), flush=True)


if __name__ == "__main__":
    main()
