"""No command writes over what it reads, whatever the options; other files are replaced by force alone.

Commands and options are found by looking at the program: one that is new has to be added here. Truth: the
bytes of all files before and after.
"""

import os
import random
import shutil
from pathlib import Path
from typing import get_type_hints

import pytest
from made_by_commands import called
from support import seeds

from rigidsim.cli.app import app

READ = {"configs", "config", "dataset", "run_path", "run_paths", "file", "kernels", "files"}
"""Parameters that name what is read."""
SCENE = ["free.toml", "moments.csv"]
RUN = [f"runs/free/{name}" for name in ("config.toml", "dataset.h5", "summary.json", "checkpoint.h5")]
SWEEP = [f"runs/swept/{name}" for name in ("config.toml", "dataset.h5", "summary.json", "tiles/sweep.json")]
FILES: list[tuple[str, dict[str, str], list[str]]] = [
    # a command, its options for files with the suffix that each wants, and what it reads
    ("compare free.toml theirs.csv", {"--out": ".h5", "--figure": ".png", "--timeline": ".rrd"},
     [*SCENE, "theirs.csv"]),
    ("compare free.toml theirs.csv --kernels clock.tsc", {"--out": ".h5"}, ["clock.tsc"]),
    ("compare free.toml runs/free", {"--out": ".h5", "--figure": ".svg"}, RUN),
    ("analyse runs/free", {"--out": ".h5"}, RUN),
    ("analyse runs/free/dataset.h5", {"--out": ".png"}, RUN),
    ("analyse theirs.csv", {"--out": ".h5"}, ["theirs.csv"]),
    ("plot runs/free", {"--out": ".png"}, RUN),
    ("plot runs/swept", {"--out": ".svg"}, SWEEP),
    ("plot theirs.csv", {"--out": ".png"}, ["theirs.csv"]),
    ("export runs/free --format csv", {"--out": ".csv"}, RUN),
    ("export runs/free --format aem --axes ICRF --epoch J2000", {"--out": ".aem"}, RUN),
    ("export runs/swept --format csv", {"--out": ".csv"}, SWEEP),
    ("view runs/free", {"--png": ".png", "--gif": ".gif", "--mp4": ".mp4"}, RUN),
    ("view fits/watched", {"--png": ".png"}, ["fits/watched/config.toml", "fits/watched/dataset.h5"]),
    ("fit watched.toml", {"--write": ".toml"}, ["watched.toml", "seen.csv"]),
    ("plan pushed.toml --physics 1deg", {"--write": ".toml"}, ["pushed.toml"]),
]  # fmt: skip
FOLDERS = [
    # a command, its config, the folder that it writes, and files there
    ("run", "free.toml", "free", ("config.toml", "dataset.h5", "summary.json", "timeline.rrd")),
    ("run --set time.start=-1", "free.toml", "free", ("config.toml", "figure.png")),
    ("sweep", "swept.toml", "swept", ("config.toml", "dataset.h5", "summary.json")),
    ("fit", "watched.toml", "watched", ("config.toml", "dataset.h5", "fitted.toml")),
    ("plan --physics 1deg", "pushed.toml", "pushed-physics", ("config.toml", "ladder.png")),
    ("tradeoff", "free.toml", "free_tradeoff", ("tradeoff.h5", "tradeoff.png")),
]


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def spelt(name: str, suffix: str, how: str) -> str:
    """The path of a file by another spelling or link."""
    link = Path(f"link{suffix}")
    if how == "symlink":
        link.symlink_to(name)
    elif how == "hard link":
        os.link(name, link)
    elif how == "relative":
        return f"runs/../{name}"
    elif how == "absolute":
        return str(Path(name).absolute())
    else:
        return name
    return str(link)


REFUSED = ("is never written over", "a name that ends in", "the suffix must be", "no picture", "a .svg",
           "no folder", "Not a directory")  # fmt: skip
HOW = ("same", "relative", "absolute", "symlink", "hard link")


def file_case(draw: random.Random) -> list[str]:
    command, options, inputs = draw.choice(FILES)
    option = draw.choice(list(options))
    return [*command.split(), option, spelt(draw.choice(inputs), options[option], draw.choice(HOW))]


def folder_case(draw: random.Random) -> list[str]:
    command, config, name, files = draw.choice(FOLDERS)
    place = Path("made") / name
    place.mkdir(parents=True)
    for beside in ("moments.csv", "seen.csv"):
        shutil.copy(beside, place)
    given = place / draw.choice(files)
    shutil.copy(config, given)
    out = draw.choice(["made", "./runs/../made", str(Path("made").absolute())])
    if draw.random() < 0.1:
        out = str(given)  # a file in the folder's place
    first, *rest = command.split()
    return [first, spelt(str(given), ".toml", draw.choice(HOW)), *rest, "--out", out]


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_no_input_is_written_over(seed: int, made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(made)
    draw = random.Random(seed)
    for _ in range(3):
        line = (file_case if draw.random() < 0.7 else folder_case)(draw)
        if draw.random() < 0.7 and line[0] not in ("plot", "view"):
            line.append("--force")
        before = bytes_of(made)
        result = called(line)
        after = bytes_of(made)
        assert result.exit_code == 2, f"{line}: {result.output}"
        assert any(words in result.stderr for words in REFUSED), f"{line}: {result.output}"
        assert {name: after.get(name) for name in before} == before, f"{line}: {result.output}"
        for path in (Path("made"), *Path().glob("link*")):
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        for name in bytes_of(made).keys() - before.keys():
            Path(name).unlink()


def test_other_files_need_force(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(made)
    for command, options, _ in FILES:
        for option, suffix in options.items():
            if suffix in (".png", ".svg", ".gif", ".mp4"):  # a picture may replace a picture
                continue
            other = Path(f"other{suffix}")
            other.write_text("of somebody else")
            result = called([*command.split(), option, str(other)])
            assert result.exit_code == 2
            assert other.read_text() == "of somebody else", command
            assert "exists; --force replaces it" in result.stderr or "--kernels" in command
            other.unlink()
    Path("coin.toml").write_text("of somebody else")
    assert called(["new", "coin"]).exit_code == 2
    assert Path("coin.toml").read_text() == "of somebody else"
    Path("coin.toml").unlink()


@pytest.mark.slow
def test_a_picture_may_replace_a_picture(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(made)
    Path("seen.png").write_bytes(b"an older one")
    assert called(["plot", "runs/free", "--out", "seen.png"]).exit_code == 0
    assert Path("seen.png").read_bytes().startswith(b"\x89PNG")
    assert called(["analyse", "runs/free", "--out", "runs/free/analysis.h5"]).exit_code == 0
    assert called(["analyse", "runs/free"]).exit_code == 2  # the same file
    assert called(["analyse", "runs/free", "--force"]).exit_code == 0


def test_each_path_of_each_command_is_tried() -> None:
    tried = {(line.split()[0], option.strip("-")) for line, options, _ in FILES for option in options}
    tried |= {(line.split()[0], "out") for line, *_ in FOLDERS}
    tried.add(("orbits", "out"))  # which reads no file of the user
    commands = [command.callback for command in app.registered_commands]
    found = {
        (function.__name__, name)
        for function in filter(None, commands)
        for name, hint in get_type_hints(function).items()
        if "Path" in str(hint) and name not in READ
    }
    assert found == tried, "say for each path whether it is read, and try it if it is written"
    assert len(found) >= 14
