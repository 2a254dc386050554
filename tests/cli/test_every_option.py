"""Every option of every command, found by looking at the program, is used by one of the lines below: each
ends with the code that it should, without a traceback, and what ``--json`` prints is strict JSON.
"""

import json
import shutil
from pathlib import Path
from typing import Any

import click
import pytest
import support
import typer
from support import cases
from typer.testing import CliRunner

import rigidsim
from rigidsim.cli import app as cli
from rigidsim.cli.app import app
from rigidsim.look import viewer
from rigidsim.look.film import vulkan_drivers

# a line of the command's arguments, and the code it ends with
QUICK = {
    "new": 0,
    "new coin my_coin": 0,
    "check free.toml swept.toml --set time.end=2 --json": 0,
    "check wrong.toml --json": 2,
    "run free.toml --out elsewhere --set time.end=1 --force --json": 0,
    "run --from runs/free/dataset.h5 --out again --json": 0,
    "run --from runs/free/dataset.h5 --out verbose --verbose": 0,
    "run --from runs/free/dataset.h5 --out verbose --force -v": 0,
    "resume runs/free --verbose": 0,
    "resume runs/free -v": 0,
    "run free.toml --out stopping --set limits.max_steps=3 --json": 3,
    "run free.toml --out scanned --sweep initial.angular_velocity[0]=[0.1,0.2] --json": 0,
    "run swept.toml --member 1 --out members --json": 0,
    "sweep swept.toml --out swept --set time.end=1 --force --json": 0,
    "sweep swept.toml --out share --tiles 0:1 --json": 0,
    "resume runs/grown --until 4 --json": 0,
    "resume runs/stopped --set limits.max_steps=100000 --json": 0,
    "resume runs/swept --workers 1 --json": 0,
    "verify runs/free --reversed --json": 0,
    "verify runs/swept --members 1 --json": 0,
    "plan free.toml --set time.end=2 --out runs --json": 0,
    "plan swept.toml --json": 0,
    "plan free.toml --physics 1arcsec --write least.toml --force --json": 2,
    "compare free.toml runs/free --set time.end=2 --within 1e-8 --out seen.h5 --figure seen.png --json": 0,
    "compare free.toml runs/free --set time.end=2 --timeline both.rrd --convention order=wxyz --force": 0,
    "tradeoff free.toml --with runs/free,long": 2,
    "compare free.toml runs/free --convention order=xwyz --offset first": 2,
    "compare free.toml missing.bc --kernels missing.tsc": 2,
    "fit watched.toml --out fits --set time.end=3 --write watched_again.toml --force --json": 0,
    "fit nights.toml --member 1 --out fits": 0,
    "info fits/watched --json": 0,
    "verify fits/watched --json": 0,
    "plot fits/watched --out fit.png": 0,
    "info runs/free --json": 0,
    "info runs/swept --json": 0,
    "plot runs/free --what drift --out drift.png": 0,
    "plot runs/free --what rates --for-slides dark --out slide.png": 0,
    "plot runs/swept --out swept.png": 0,
    "analyse runs/free --variable angular_velocity.z --lines 1 --out lines.h5 --force --json": 0,
    "export runs/free --format aem --out free.aem --force --epoch J2000 --axes ICRF --object-name COIN": 0,
    "export runs/free --format apm --out free.apm --epoch J2000 --axes ICRF --message time=TT,at=0": 0,
    "export runs/free --format oem --out free.oem --epoch J2000 --frame ICRF --object-id 2000-001A": 0,
    "export runs/free --out free.csv --angle-unit deg --variable quaternion": 0,
    "export runs/free --out free.doc": 2,
    "orbits pluto --end -1kyr --every 1kyr --window 0 --kernel de421 --out here --force --resume --json": 2,
    "schema": 0,
    "--version": 0,
    "--help": 0,
    "info -h": 0,
}
LONG = {
    "sweep swept.toml --out shared --workers 2 --json": 0,
    "sweep swept.toml --out cluster --scheduler nowhere:1 --json": 2,
    "view runs/free --web": 0,
    "view runs/free --png free.png": 0,
    "view runs/free --png moment.png --at 0.5 --part scene": 0,
    "view runs/swept --member 1 --gif member.gif --seconds 0.5": 0,
    "view runs/free --mp4 free.mp4 --seconds 0.5": 0,
    "tradeoff free.toml --set time.end=2 --out measured --budget 5 --repeats 1 --full --force --json": 0,
}
FROM_TYPER = {"--install-completion", "--show-completion"}  # they change the user's shell
FLYING = {
    "initial": "angular_velocity = [0.3, 1.0, 0.5]\nposition = [0, 0, 0]\nvelocity = [1, 0, 0]",
    "output": 'record = ["quaternion", "angular_velocity", "obliquity", "position", "velocity"]',
}
FIT = """[fit]
parameters = ["initial.angular_velocity[0]"]
[[fit.data]]
file = "seen.csv"
observable = "angular_velocity"
columns = ["x", "y", "z"]
sigma = 0.01"""
SWEEP = "[sweep]\naxes.'initial.angular_velocity[0]' = {values = [0.1, 0.2]}"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with configs and their runs."""
    folder = tmp_path_factory.mktemp("every option")
    texts = {
        "free": support.config(body="principal_moments = [1, 2, 2.5]\nmass = 1", **FLYING, name="free"),
        "stopped": support.config(more="[limits]\nmax_steps = 3", name="stopped"),
        "swept": support.config(more=SWEEP, name="swept"),
        "watched": support.config(more=FIT, name="watched"),
        "nights": support.config(more=f"{FIT}\n{SWEEP}", name="nights"),
        "wrong": support.config(body="principal_moments = [1, 2, 9]", name="wrong"),
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name, text in texts.items():
            Path(f"{name}.toml").write_text(text)
        Path("seen.csv").write_text("time,x,y,z\n0,0.1,1,0.05\n0.1,0.1,1,0.05\n")
        called("fit watched.toml", 0)
        called("run free.toml", 0)
        called("run stopped.toml", 3)
        called("sweep swept.toml", 0)
        shutil.copytree("runs/free", "runs/grown")
    return folder


def called(line: str, code: int) -> Any:
    """The result of a command line, which ends with a code."""
    result = CliRunner().invoke(app, line.split(), prog_name="rigidsim")
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exc_info
    assert result.exit_code == code, result.output
    assert "Traceback" not in result.output
    return result


def strictly(text: str) -> list[Any]:
    """JSON values, one a line or one alone, without what only Python reads."""

    def refused(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    parts = [text] if text.startswith("{\n") else text.splitlines()
    return [json.loads(part, parse_constant=refused) for part in parts]


def test_each_option_is_in_a_line() -> None:
    program = typer.main.get_command(app)
    assert isinstance(program, click.Group) or hasattr(program, "commands")
    lines = [line.split() for line in (*QUICK, *LONG)]
    missing = []
    for name, command in program.commands.items():  # type: ignore[attr-defined]
        used = {word for words in lines if words[0] == name for word in words}
        if not used:
            missing.append(name)
        options = [o for p in command.params if isinstance(p, click.Option) or p.param_type_name == "option"
                   for o in p.opts]  # fmt: skip
        missing += [f"{name} {option}" for option in options if option not in used]
    own = {o for p in program.params for o in p.opts if o.startswith("-")} - FROM_TYPER
    missing += sorted(own - {word for words in lines for word in words})
    assert not missing, f"add a line for each of {missing}"


def test_help_shows_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No word of a docstring is taken for markup, and scenes of examples are there in an empty folder."""
    monkeypatch.chdir(tmp_path)
    for name in typer.main.get_command(app).commands:  # type: ignore[attr-defined]
        text = " ".join(called(f"{name} -h", 0).output.split())
        declared = getattr(cli, name).__doc__
        assert " ".join(declared.split()) in text
        example = declared.partition("Example: ")[2].partition(";")[0].split()
        assert example[:2] == ["rigidsim", name]
        if name in ("new", "check", "run", "sweep", "plan", "compare", "fit", "tradeoff"):
            rigidsim.load(example[2])
        for option in example:
            assert not option.startswith("--") or option in text


def run_line(line: str, code: int, folder: Path, patch: pytest.MonkeyPatch) -> None:
    """Run one line in the folder, and read what it printed."""
    patch.chdir(folder)
    result = called(line, code)
    if ("--json" in line.split() and code != 2) or line == "schema":
        assert strictly(result.stdout), line
    if code and not line.startswith("check"):  # its findings are its result
        assert "rigidsim: " in result.stderr, "no word why"
    for option in ("--out", "--png", "--gif", "--mp4"):
        if option in (words := line.split()):
            assert Path(words[words.index(option) + 1]).exists() or code == 2, line  # nothing begun


@pytest.mark.parametrize("line", cases(QUICK, list(QUICK)[2::4], daily=8))
def test_a_quick_line(line: str, made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run_line(line, QUICK[line], made, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("line", LONG)
def test_a_long_line(line: str, made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if any(option in line for option in ("--gif", "--mp4", "--png")) and not vulkan_drivers():
        pytest.skip("no Vulkan driver: apt-get install mesa-vulkan-drivers")

    def closed_at_once(path: Path, *, web: bool) -> int:
        return 0

    monkeypatch.setattr(viewer, "open_viewer", closed_at_once)
    run_line(line, LONG[line], made, monkeypatch)
