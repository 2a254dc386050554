"""Every command on tiny experiments: what it prints, what it writes, how it ends."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import cases, same_bits

import rigidsim
from rigidsim.look import viewer

Config = Callable[..., str]
Command = Callable[..., Any]


def read(folder: str | Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((Path(folder) / "summary.json").read_text())
    return content


def files(folder: str | Path = ".") -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in Path(folder).rglob("*") if p.is_file())


def no_traceback(result: Any) -> None:
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert "Traceback" not in result.output


# run


def test_run_writes_a_folder_and_prints_a_table(config: Config, rigidsim_command: Command) -> None:
    result = rigidsim_command("run", config(), "--verbose")
    assert result.exit_code == 0, result.output
    assert files("runs/free") == ["checkpoint.h5", "config.toml", "dataset.h5", "summary.json"]
    summary = read("runs/free")
    lines = result.stdout.splitlines()
    assert lines[0].split() == ["free", "finished"]
    assert f"{summary['cost']['steps']} steps, 49 of 49 samples" in result.stdout
    for name, row in summary["invariants"].items():
        line = next(line for line in lines if line.startswith(f"{name} "))
        assert f"{row['largest_drift']:.2e}" in line
        assert f"{row['bound']:.2e}" in line
    assert "runs/free" in lines[-1]
    assert "integrating into runs/free" in result.stderr  # progress is no result
    assert "integrating into" not in result.stdout


def test_run_refuses_all_before_it_starts_any(config: Config, rigidsim_command: Command) -> None:
    bad = config("bad", time="end = 3\nsamples = 49\ntypo = 1")
    result = rigidsim_command("run", config("good"), bad)
    assert result.exit_code == 2
    no_traceback(result)
    assert "bad.toml: 1 problem in the config" in result.stderr
    assert "[time] typo" in result.stderr
    assert result.stdout == ""
    assert not Path("runs").exists()


# plan


def test_plan_json(config: Config, rigidsim_command: Command) -> None:
    result = rigidsim_command("plan", config(), "--json", "--set", "integrator.formulation=rotation_matrix")
    assert result.exit_code == 0, result.output
    plan = json.loads(result.stdout)
    assert plan["states"][:3] == ["wx", "wy", "wz"]
    assert plan["state_count"] == len(plan["states"]) == 12
    assert [row["states"] for row in plan["reasons"]] == ["wx wy wz", "r11 ... r33"]
    assert all(row["why"] for row in plan["reasons"] + plan["left_out"] + plan["invariants"])
    assert len(plan["equations"]) == 12
    assert {"time", "angular_velocity", "rotation_matrix", "energy_drift"} <= set(plan["recorded"])
    assert plan["predicted"]["dataset_bytes"] > 0
    assert plan["predicted"]["growth_seconds"] > 0
    told = rigidsim_command("plan", config()).stdout
    assert "if errors go on growing as in the first" in told


@pytest.mark.parametrize(
    ("time", "integrator"),
    [
        ("end = 20000\nsamples = 11", ""),
        pytest.param("end = 300\nsamples = 4", 'precision = "quadruple"', marks=pytest.mark.slow),
    ],
)
def test_plan_predicts_the_steps(
    time: str, integrator: str, config: Config, rigidsim_command: Command
) -> None:
    """Within a fifth: a pilot of many periods of the motion knows the mean step."""
    name = config(time=time, integrator=integrator)
    predicted = json.loads(rigidsim_command("plan", name, "--json").stdout)["predicted"]["steps"]
    assert rigidsim_command("run", name).exit_code == 0
    assert predicted == pytest.approx(read("runs/free")["cost"]["steps"], rel=0.2)


# info, plot, view, schema


def test_info_of_a_finished_run(config: Config, rigidsim_command: Command) -> None:
    printed = rigidsim_command("run", config(), "-v").stdout.splitlines()
    for path in ("runs/free", "runs/free/dataset.h5"):
        result = rigidsim_command("info", path)
        assert result.exit_code == 0, result.output
        lines = result.stdout.splitlines()
        assert lines[: len(printed)] == printed
        rest = " ".join(" ".join(lines[len(printed) :]).split())
        assert rest.startswith("dataset 49 samples of angular_velocity, quaternion, ")
    machine = rigidsim_command("info", "runs/free", "--json")
    assert json.loads(machine.stdout) == read("runs/free")


def test_an_edited_dataset_is_told_by_whatever_looks_at_the_run(
    config: Config, rigidsim_command: Command
) -> None:
    rigidsim_command("run", config())
    dataset = Path("runs/free/dataset.h5")
    content = bytearray(dataset.read_bytes())
    content[len(content) // 2] ^= 1
    dataset.write_bytes(content)
    for given in (("info",), ("info", "--json"), ("resume",)):
        told = rigidsim_command(*given[:1], "runs/free", *given[1:])
        assert told.exit_code == 2
        assert "dataset.h5: is damaged or was edited" in told.stderr
    compared = rigidsim_command("verify", "runs/free", "--json")
    assert compared.exit_code == 1
    assert "dataset.h5: is damaged or was edited" in json.loads(compared.stdout)["problems"][0]


@pytest.mark.parametrize("path", ["runs/nothing", "nothing.h5", "."])
@pytest.mark.parametrize("command", ["info", "plot", "view"])
def test_there_is_no_run(command: str, path: str, config: Config, rigidsim_command: Command) -> None:
    config()
    result = rigidsim_command(command, path)
    assert result.exit_code == 2
    no_traceback(result)
    assert result.stderr.startswith(f"rigidsim: {path}: no run here; give a run folder")


def test_plot_by_name(config: Config, rigidsim_command: Command, tmp_path: Path) -> None:
    """Each into a file of its own in the run, which --force removes with the run; or into a folder."""
    rigidsim_command("run", config())
    result = rigidsim_command("plot", "runs/free", "--what", "rates", "--what", "drift")
    assert result.stdout.split() == ["runs/free/figure_rates.png", "runs/free/figure_drift.png"]
    (tmp_path / "all").mkdir()
    result = rigidsim_command("plot", "runs/free", "--what", "rates", "--what", "drift", "--out", "all")
    assert result.stdout.split() == ["all/figure_rates.png", "all/figure_drift.png"]
    for options, message in (
        (
            ["--what", "polhodes"],
            "none of that name; did you mean 'polhode'? Available: overview, polar_motion",
        ),
        (
            ["--what", "libration"],
            "needs libration, roll_pitch_yaw, nadir or source_position recorded, which this run hasn't",
        ),
        (["--what", "all", "--out", "x.png"], "x.png: several figures need a folder that is there"),
    ):
        result = rigidsim_command("plot", "runs/free", *options)
        assert result.exit_code == 2
        no_traceback(result)
        assert message in " ".join(result.stderr.split())
    assert rigidsim_command("run", config(), "--force").exit_code == 0
    assert not Path("runs/free/figure_rates.png").exists()


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("x.pdf", "the suffix must be one of .png, .svg, given '.pdf'"),
        ("x", "the suffix must be one of .png, .svg, given ''"),
        ("no/such/folder.png", "there is no folder no/such; make it first"),
    ],
)
def test_plot_of_a_wrong_target(target: str, message: str, config: Config, rigidsim_command: Command) -> None:
    rigidsim_command("run", config())
    before = files()
    result = rigidsim_command("plot", "runs/free", "--out", target)
    assert result.exit_code == 2
    no_traceback(result)
    assert message in result.stderr
    assert files() == before


@pytest.mark.parametrize("web", [False, True])
def test_view(web: bool, config: Config, rigidsim_command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run without a timeline gets one first; the viewer's exit code is handed on."""
    opened: list[tuple[Path, bool]] = []

    def pretend(path: Path, *, web: bool) -> int:
        opened.append((path, web))
        return 130 if web else 0

    monkeypatch.setattr(viewer, "open_viewer", pretend)
    rigidsim_command("run", config())
    assert not Path("runs/free/timeline.rrd").exists()
    result = rigidsim_command("view", "runs/free", *(["--web"] if web else []))
    assert result.exit_code == (130 if web else 0), result.output
    assert opened == [(Path("runs/free/timeline.rrd"), web)]
    assert Path("runs/free/timeline.rrd").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["runs/free", "--png", "x.jpg"], "--png: given x.jpg; a name that ends in .png is allowed"),
        (["runs/free", "--gif", "nowhere/x.gif"], "there is no folder nowhere; make it first"),
        (["runs/free", "--gif", "x.gif", "--web"], "--web: opens the viewer, but --png"),
        (["runs/free", "--seconds", "3"], "--seconds: is for films (--gif, --mp4)"),
        (["runs/free", "--member", "2"], "--member is for one sweep: give its folder"),
        (["runs/free", "runs/none"], "no run here"),
    ],
)
def test_what_cannot_be_viewed_is_said(
    arguments: list[str], message: str, config: Config, rigidsim_command: Command
) -> None:
    rigidsim_command("run", config())
    result = rigidsim_command("view", *arguments)
    assert result.exit_code == 2
    no_traceback(result)
    assert message in result.stderr


@pytest.mark.slow
def test_runs_and_members_of_a_sweep_are_viewed_side_by_side(
    config: Config, rigidsim_command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rerun.chunk import RrdReader

    names: list[set[str]] = []

    def pretend(path: Path, *, web: bool) -> int:
        names.append({chunk.entity_path for chunk in RrdReader(path).stream()})
        return 0

    monkeypatch.setattr(viewer, "open_viewer", pretend)
    rigidsim_command("run", config(), "--set", 'name="other"')
    text = (
        Path(config()).read_text()
        + "\n[sweep]\naxes.'initial.angular_velocity[0]' = {values = [0.1, 0.2, 0.3]}\n"
    )
    Path("swept.toml").write_text(text)
    rigidsim_command("run", config())
    assert rigidsim_command("view", "runs/free", "runs/other").exit_code == 0
    assert rigidsim_command("sweep", "swept.toml", "--out", "sweeps").exit_code == 0
    refused = rigidsim_command("view", "sweeps/free")
    assert refused.exit_code == 2
    assert "choose members of it with --member N" in refused.stderr
    result = rigidsim_command("view", "sweeps/free", "--member", "0", "--member", "2")
    assert result.exit_code == 0, result.output
    for entities in names:
        assert {"/run0/scene/body", "/run1/scene/body", r"/plots/drift/difference\ 1"} <= entities
    assert len(names) == 2


# Guards

GUARDS = {
    "max_steps": ("end = 1e6\nevery = 1", "max_steps = 700", ""),
    "wall_time": ("end = 1e8\nevery = 1", 'wall_time = "0.2 s"', 'precision = "extended"'),
    "max_drift": ("end = 1e6\nevery = 1", "max_drift = 3e-6", 'precision = "single"'),
}


@pytest.mark.parametrize("guard", cases(GUARDS, ["max_steps"]))
def test_a_guard_ends_the_run_and_keeps_the_samples(
    guard: str, config: Config, rigidsim_command: Command
) -> None:
    time, limit, integrator = GUARDS[guard]
    name = config(time=time, integrator=integrator, rest=f"[limits]\n{limit}")
    result = rigidsim_command("run", name)
    assert result.exit_code == 3
    no_traceback(result)
    summary = read("runs/free")
    assert summary["status"] == f"stopped: {guard}"
    assert summary["exit_code"] == 3
    assert f"[limits] {guard}" in summary["message"]
    assert summary["message"] in result.stderr
    assert f"free  stopped: {guard}" in result.stdout
    assert summary["bit_for_bit"]["claim"] is False
    if guard == "max_steps":
        assert summary["cost"]["steps"] == 700
    if guard == "max_drift":
        assert max(row["largest_drift"] for row in summary["invariants"].values()) > 3e-6
    with rigidsim.open_run("runs/free").dataset as dataset:
        count = dataset.sizes["time"]
        assert 0 < count == summary["samples"] < summary["samples_planned"]
        np.testing.assert_array_equal(dataset.time, np.arange(count))
        assert dataset.attrs["status"] == f"stopped: {guard}"
        assert all(np.isfinite(dataset[v]).all() for v in dataset.data_vars)
    info = rigidsim_command("info", "runs/free")
    assert info.exit_code == 0
    assert f"free  stopped: {guard}" in info.stdout
    assert f"{count:,} samples of " in " ".join(info.stdout.split())
    assert rigidsim_command("plot", "runs/free", "--out", "x.png").exit_code == 0
    assert Path("x.png").stat().st_size > 20_000


def test_a_guard_that_is_not_reached_changes_nothing(config: Config, rigidsim_command: Command) -> None:
    limits = "[limits]\nmax_steps = 1_000_000\nmax_drift = 1e-9\nwall_time = 3600"
    assert rigidsim_command("run", config(rest=limits)).exit_code == 0
    assert rigidsim_command("run", config("plain")).exit_code == 0
    same_bits(rigidsim.open_run("runs/free"), rigidsim.open_run("runs/plain"))


def test_a_stopped_run_does_not_stop_the_next(config: Config, rigidsim_command: Command) -> None:
    stopped = config("a", time="end = 1e6\nevery = 1", rest="[limits]\nmax_steps = 10")
    result = rigidsim_command("run", stopped, config("b"))
    assert result.exit_code == 3
    assert read("runs/a")["status"] == "stopped: max_steps"
    assert read("runs/b")["status"] == "finished"


# Outside of any command


def test_an_unknown_command(rigidsim_command: Command) -> None:
    result = rigidsim_command("rnu")
    assert result.exit_code == 2
    assert "rnu" in result.stderr


@pytest.mark.parametrize("command", ["run", "plan", "info", "view", "plot", "schema"])
def test_each_command_helps_with_an_example(command: str, rigidsim_command: Command) -> None:
    listed, own = rigidsim_command("--help"), rigidsim_command(command, "--help")
    assert listed.exit_code == own.exit_code == 0
    assert f" {command} " in listed.stdout
    assert f"Example: rigidsim {command}" in " ".join(own.stdout.split())


def python(code: str, *arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, cwd=cwd, timeout=60
    )


def test_version() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rigidsim", "--version"], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout) == (0, f"rigidsim {rigidsim.__version__}\n")


HEAVY = "{'rerun', 'xarray', 'matplotlib', 'heyoka', 'dask', 'h5py', 'numpy'}"


def test_help_loads_nothing_heavy() -> None:
    done = python(
        "import sys\nfrom rigidsim.cli.app import app\n"
        "try: app(['--help'])\nexcept SystemExit: pass\n"
        f"print('loaded:', sorted({HEAVY} & set(sys.modules)))"
    )
    assert done.returncode == 0, done.stderr
    assert "Usage:" in done.stdout
    assert done.stdout.splitlines()[-1] == "loaded: []"


UNUSED = "{'rerun', 'xarray', 'pandas', 'matplotlib', 'dask', 'pyarrow', 'scipy', 'html'}"
OWN_MODULES = 298
"""That a short run loads, at 0.3 ms each, besides the kinds of loads, which any config may name: what is
seldom needed is loaded where it is used."""


def test_a_run_loads_nothing_that_it_does_not_use(config: Config) -> None:
    code = (
        "import sys\nfrom rigidsim.cli.app import main\n"
        "def run(*arguments):\n"
        f"    sys.argv = ['rigidsim', 'run', {config()!r}, *arguments]\n"
        "    try: main()\n"
        "    except SystemExit as end: assert end.code == 0, end.code\n"
        "run()\n"
        f"print('loaded:', sorted({UNUSED} & set(sys.modules)),"
        " sum(name.split('.')[0] == 'rigidsim' and '.loads.' not in name for name in sys.modules),"
        " len(sys.modules))\n"
        "run('--force', '--set', 'output.timeline=true')\n"
        "print('loaded:', sorted({'rerun', 'matplotlib'} & set(sys.modules)))"
    )
    done = python(code)
    assert done.returncode == 0, done.stderr
    printed = done.stdout.splitlines()
    plain, drawn = (line for line in printed if line.startswith("loaded: "))
    assert printed[0] == "free  finished"
    assert plain.startswith("loaded: [] ")
    own, whole = (int(count) for count in plain.split()[-2:])
    assert own <= OWN_MODULES
    assert whole - own < 620  # 600 with the libraries that constraints.txt names
    assert drawn == "loaded: ['rerun']"


def test_importing_loads_nothing_prints_nothing_and_writes_nothing(tmp_path: Path) -> None:
    done = python(
        "import sys\nopened = []\n"
        "def hook(event, args):\n"
        "    writes = event == 'open' and isinstance(args[1], str) and set('wax+') & set(args[1])\n"
        "    if writes or event in ('os.mkdir', 'os.rename', 'os.remove', 'socket.connect'):\n"
        "        opened.append((event, *args))\n"
        "sys.dont_write_bytecode = True\n"
        "sys.addaudithook(hook)\n"
        "import rigidsim\n"
        f"assert not {HEAVY} & set(sys.modules), {HEAVY} & set(sys.modules)\n"
        "assert not opened, opened\n"
        "assert set(rigidsim.__all__) <= set(dir(rigidsim))",
        cwd=tmp_path,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert list(tmp_path.iterdir()) == []


def test_the_names_of_the_package_stay_functions() -> None:
    """Whichever is used first, and whatever is imported beside it."""
    done = python(
        "import rigidsim, rigidsim.cli.app\n"
        "from rigidsim import open_run\nfrom rigidsim.store.run import Run\n"
        "import rigidsim.workflows.run, rigidsim.workflows.plan\n"
        "names = [rigidsim.run, rigidsim.plan, rigidsim.load, rigidsim.parse, rigidsim.open_run]\n"
        "print([type(n).__name__ for n in names])"
    )
    assert done.stdout.strip() == str(["function"] * 5), done.stderr


# What a terminal shows


@pytest.mark.parametrize("width", [80, 120])
def test_the_bar_is_one_line(width: int, config: Config) -> None:
    """Name, bar, percentage, rate and time left, none of them cut."""
    from rich.console import Console

    from rigidsim.session.progress import TerminalObserver
    from rigidsim.solve.problem import prepare
    from rigidsim.solve.sampler import Progress

    prepared = prepare(rigidsim.load(config("a_name_of_more_than_twenty_four_letters", time="end = 1000")))
    screen = io.StringIO()
    console = Console(width=width, file=screen, force_terminal=True, color_system=None)
    now = [0.0]
    with TerminalObserver(console, lambda: now[0]) as observer:
        observer.started(prepared, Path("runs/x"))
        now[0] += 3600.0
        observer.progressed(Progress(11, steps=7_200_000_000, time=250.0))
        observer._bar.refresh()
        shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue()).replace("\r", "\n")
        line = next(x for x in reversed(shown.splitlines()) if "%" in x)
        assert len(line.rstrip()) <= width
        assert line.startswith("a_name_of_more_than_twe… ━")
        assert " 25.0 %" in line
        assert "2 M steps/s" in line
        assert "3:00:00 left" in line  # three quarters at the pace of one quarter an hour
        assert ("t = 250 s" in line) == (width >= 100)
        observer.phase("dataset")
        observer._bar.refresh()
        shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue()).replace("\r", "\n")
        last = [x for x in shown.splitlines() if x.strip()][-1]
        assert last.startswith("writing dataset.h5")
        assert "left" not in last  # how long it takes isn't known
