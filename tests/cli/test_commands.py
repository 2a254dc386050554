"""Every command on tiny experiments: what it prints, what it writes, how it ends."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

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
    for path in ("runs/free", "runs/free/dataset.h5"):
        told = rigidsim_command("info", path)
        assert told.exit_code == 0, told.output
        assert told.stdout.splitlines()[: len(lines)] == lines
    assert json.loads(rigidsim_command("info", "runs/free", "--json").stdout) == summary


def test_run_refuses_all_before_it_starts_any(config: Config, rigidsim_command: Command) -> None:
    bad = config("bad", time="end = 3\nsamples = 49\ntypo = 1")
    result = rigidsim_command("run", config("good"), bad)
    assert result.exit_code == 2
    no_traceback(result)
    assert "bad.toml: 1 problem in the config" in result.stderr
    assert "[time] typo" in result.stderr
    assert result.stdout == ""
    assert not Path("runs").exists()


def python(code: str, *arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, cwd=cwd, timeout=60
    )


HEAVY = "{'rerun', 'xarray', 'matplotlib', 'heyoka', 'dask', 'h5py', 'numpy'}"


UNUSED = "{'rerun', 'xarray', 'pandas', 'matplotlib', 'dask', 'pyarrow', 'scipy', 'html'}"


@pytest.mark.parametrize(
    ("arguments", "unused", "shown"),
    [(["--help"], HEAVY, "Usage:"), (["run", "free.toml"], UNUSED, "free  finished")],
)
def test_help_and_runs_load_nothing_that_they_do_not_use(
    arguments: list[str], unused: str, shown: str, config: Config
) -> None:
    config()
    done = python(
        "import sys\nfrom rigidsim.cli.app import app\n"
        f"try: app({arguments})\nexcept SystemExit: pass\n"
        f"print('loaded:', sorted({unused} & set(sys.modules)))"
    )
    assert done.returncode == 0, done.stderr
    assert shown in done.stdout
    assert done.stdout.splitlines()[-1] == "loaded: []"


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
