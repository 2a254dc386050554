"""How large the house is, and how many rooms ask questions that one of them should answer.

    python tests/house_figures.py [COMMIT ...]

prints a table with a column for each commit, and one for the working tree.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tarfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
LONGEST = 350
"""Lines of a module."""

Sources = Mapping[str, str]
"""Python code by path, relative to the repository."""


@dataclass(frozen=True)
class Question:
    """A question about a kind of thing that should be answered where the kinds are defined.

    Attributes:
        names: of the kinds, in configs and datasets.
        attributes: that answer the question elsewhere.
        homes: folders that may ask it.
    """

    names: tuple[str, ...]
    attributes: tuple[str, ...]
    homes: tuple[str, ...]

    def named_in(self, sources: Sources) -> list[str]:
        """Modules outside the homes that name a kind in quotes, or read such an attribute."""
        quoted = "|".join(f"\"{name}\"|'{name}'" for name in self.names)
        found = re.compile("|".join([quoted, *(rf"\.{name}\b" for name in self.attributes)]))
        return [path for path, code in self._outside(sources) if found.search(code)]

    def asked_in(self, sources: Sources) -> list[str]:
        """Modules outside the homes that compare with a kind's name, or read such an attribute."""
        return [
            path for path, code in self._outside(sources) if any(map(self._asks, ast.walk(ast.parse(code))))
        ]

    def _outside(self, sources: Sources) -> Iterator[tuple[str, str]]:
        return ((path, code) for path, code in sources.items() if not path.startswith(self.homes))

    def _asks(self, node: ast.AST) -> bool:
        if isinstance(node, ast.Attribute):
            return node.attr in self.attributes
        if isinstance(node, ast.Compare):
            within = [part for side in (node.left, *node.comparators) for part in ast.walk(side)]
        else:
            within = [node.value] if isinstance(node, ast.MatchValue) else []
        return any(isinstance(part, ast.Constant) and part.value in self.names for part in within)


SOLVER = Question(
    ("taylor", "closed_form"),
    ("closed",),
    ("rigidsim/scene/", "rigidsim/solve/closed_form/", "rigidsim/solve/solvers/"),
)

FORMULATION = Question(
    ("rates", "quaternion", "euler_angles", "rotation_matrix", "canonical", "planar"),
    ("canonical", "planar", "average", "averaged"),
    ("rigidsim/scene/", "rigidsim/model/formulations/", "rigidsim/model/averaged/"),
)
"""Most of these are names of recorded variables, too: half of the modules that are counted ask for such."""


def of_folder(root: Path) -> Sources:
    """The Python code of the package and of its tests as it stands in a folder."""
    paths = [path for top in ("rigidsim", "tests") for path in sorted((root / top).rglob("*.py"))]
    return {path.relative_to(root).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def of_commit(commit: str) -> Sources:
    """The same at a commit."""
    command = ["git", "archive", "--format=tar", commit, "rigidsim", "tests"]
    packed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as tar:
        files = {entry.name: tar.extractfile(entry) for entry in tar if entry.name.endswith(".py")}
        return {path: file.read().decode() for path, file in files.items() if file is not None}


def package(sources: Sources) -> Sources:
    """The package's own."""
    return {path: code for path, code in sources.items() if path.startswith("rigidsim/")}


def length(code: str) -> int:
    """Lines of a module."""
    return len(code.splitlines())


def late_imports(code: str) -> int:
    """Import statements within functions."""
    functions = [
        n for n in ast.walk(ast.parse(code)) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    imports = {n for f in functions for n in ast.walk(f) if isinstance(n, ast.Import | ast.ImportFrom)}
    return len(imports)  # once each, though functions are nested


def figures(sources: Sources) -> dict[str, int]:
    """The figures of a table, by what is counted."""
    own = package(sources)
    lengths = {path: length(code) for path, code in sources.items()}
    return {
        "lines of `rigidsim/`": sum(lengths[path] for path in own),
        "lines of `tests/`": sum(n for path, n in lengths.items() if path not in own),
        "modules of `rigidsim/`": len(own),
        f"modules over {LONGEST} lines": sum(lengths[path] > LONGEST for path in own),
        "imports within functions": sum(map(late_imports, own.values())),
        "modules that name a solver": len(SOLVER.named_in(own)),
        "modules that ask which solver it is": len(SOLVER.asked_in(own)),
        "modules that name a formulation": len(FORMULATION.named_in(own)),
        "modules that ask which formulation it is": len(FORMULATION.asked_in(own)),
    }


def table(columns: Mapping[str, Mapping[str, int]]) -> str:
    """The figures as a table in Markdown, by the columns' headings."""
    heads = ["", *columns]
    rows = [
        [what, *(f"{column[what]:,}" for column in columns.values())] for what in next(iter(columns.values()))
    ]
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    read = {commit: of_commit(commit) for commit in sys.argv[1:]} | {"working tree": of_folder(ROOT)}
    print(table({name: figures(sources) for name, sources in read.items()}))
    for name, sources in read.items():
        for kind, question in (("solver", SOLVER), ("formulation", FORMULATION)):
            print(f"\n{name}: these name a {kind} (* and ask which it is)")
            asked = question.asked_in(own := package(sources))
            print("\n".join(f"  {path}{' *' if path in asked else ''}" for path in question.named_in(own)))
