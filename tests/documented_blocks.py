"""What the pages of the documentation show as code, taken apart and run, page by page, as a reader would.

Blocks of a page run in one empty folder, from top to bottom, with the repository's ``configs`` at hand unless
the page says that it needs nothing but an empty folder:

- ``sh``: each line is a command; those of ``rigidsim`` run here, others have to be marked;
- ``python``: all blocks of a page share their names;
- ``toml``: below ``<!-- file: NAME -->`` a file of that name, which later blocks use; else a fragment, which
  has to be right together with a small complete scene;
- without a language: nothing, unless ``<!-- prints -->`` stands above it: what the block before it printed.

``<!-- before: COMMAND -->`` runs where it stands and isn't shown; ``<!-- not run: WHY -->`` above a block
says why it isn't run; of pages with ``<!-- blocks: slow -->`` the long stage runs some, drawn by the day.
"""

import contextlib
import io
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_PIECE = re.compile(
    r"<!-- before: (?P<before>.+?) -->"
    r"|(?:<!-- (?P<mark>file: \S+|not run: [^>]+?|prints|test: [^>]+?|(?:slow )?output: [^>]+?) -->\n+)?"
    r"^(?P<indent> *)```(?P<language>[\w{}-]*)\n(?P<text>.*?)^ *```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A block of code.

    Attributes:
        language: ``sh``, ``python``, ``toml``, "" or what else stands behind the fence; "before" for a
            command that isn't shown.
        mark: of the comment above it.
        line: in the page, counted from 1.
        span: of the text in the page.
    """

    page: Path
    language: str
    mark: str
    text: str
    line: int
    span: tuple[int, int]

    @property
    def run(self) -> bool:
        """Whether it is one for this machinery: outputs have tests of their own."""
        if self.mark.startswith(("not run", "output", "slow output")):
            return False
        return self.language in ("sh", "python", "toml", "before") or self.mark == "prints"


def blocks_of(page: Path) -> list[Block]:
    """All blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in _PIECE.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        if match["before"]:
            found.append(Block(page, "before", "", match["before"], line, match.span("before")))
            continue
        indent = len(match["indent"])
        body = "".join(row[indent:] if row.strip() else row for row in match["text"].splitlines(True))
        mark, language = match["mark"] or "", match["language"]
        found.append(Block(page, language, mark, body, line, match.span("text")))
    return found


def is_slow(page: Path) -> bool:
    """Whether its blocks run in the long stage, on some days."""
    return "<!-- blocks: slow -->" in page.read_text(encoding="utf-8")


def prepare(page: Path, folder: Path) -> None:
    """Put into a folder what a page may expect there."""
    if "empty folder" not in page.read_text(encoding="utf-8"):
        (folder / "configs").symlink_to(Path(__file__).parents[1] / "configs")


class Story:
    """Runs the blocks of a page in the current folder.

    Attributes:
        printed: by the last block, both of commands and of Python.
    """

    def __init__(self) -> None:
        self.names: dict[str, Any] = {"__name__": "__main__"}
        self.printed = ""

    def play(self, block: Block) -> None:
        """Run one block that is to be run, and isn't a print.

        Raises:
            AssertionError: a command fails, or isn't one of rigidsim's.
            Exception: whatever Python raises.
        """
        if block.language == "toml":
            name = block.mark.removeprefix("file: ")
            if block.mark:
                Path(name).write_text(block.text, encoding="utf-8")
            else:
                check_fragment(block.text)
            return
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            if block.language == "python":
                code = "\n" * block.line + block.text
                exec(compile(code, str(block.page), "exec", dont_inherit=True), self.names)
            else:
                for words, expected in commands(block.text):
                    run_command(words, expected)
        self.printed = said.getvalue()


def commands(text: str) -> Iterator[tuple[list[str], int]]:
    """Lines of a shell as words, comments and continued lines as in a shell, each with the exit code that a
    comment behind it names (``# exit 3: a guard``).
    """
    for line in text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        code = re.search(r"# exit (\d+)", line)
        if words:
            yield words, int(code[1]) if code else 0


def run_command(words: list[str], expected: int) -> None:
    """A command of rigidsim in this process.

    Raises:
        AssertionError: it isn't one of rigidsim, or has another exit code.
    """
    from rigidsim.cli.app import app

    assert words[0] == "rigidsim", f"{words}: mark a block that isn't run with <!-- not run: WHY -->"
    into = words.index(">") if ">" in words else None
    given = words[1:into]
    said = io.StringIO()
    with contextlib.redirect_stdout(said) if into else contextlib.nullcontext():
        try:
            code = app(given, prog_name="rigidsim")
        except SystemExit as ended:
            code = ended.code
    if into:
        Path(words[into + 1]).write_text(said.getvalue(), encoding="utf-8")
    assert (code or 0) == expected, f"{' '.join(words)}: exit code {code}"


_BASE: dict[str, Any] = {
    "name": "fragment",
    "body": {"principal_moments": [1, 2, 2.5], "mass": 1},
    "initial": {"angular_velocity": [0.1, 1, 0.05]},
    "time": {"end": 1, "samples": 11},
}
_ONE_OF = {
    "body": {"principal_moments", "inertia_tensor", "points", "shape", "parts", "preset"},
    "initial": {"angular_velocity", "angular_momentum"},
    "time": {"samples", "every", "times"},
}


def check_fragment(text: str) -> None:
    """A part of a config is right together with a small complete scene; what excludes each other is replaced.

    Raises:
        ConfigError: it isn't.
    """
    import tomllib

    from rigidsim import Experiment

    given = tomllib.loads(text)
    whole: dict[str, Any] = {}
    for name in {**_BASE, **given}:
        own, base = given.get(name), _BASE.get(name)
        if isinstance(own, dict) and isinstance(base, dict):
            exclusive = _ONE_OF.get(name, set())
            if exclusive & own.keys():
                base = {key: value for key, value in base.items() if key not in exclusive}
            if "times" in own:
                base.pop("end", None)
            whole[name] = {**base, **own}
        else:
            whole[name] = base if own is None else own
    Experiment.from_dict(whole)
