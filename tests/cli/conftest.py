"""Small experiments for the tests of commands."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import support
from typer.testing import CliRunner

from rigidsim.cli.app import app


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Writes ``NAME.toml`` in an empty working folder and returns its name; see ``support.config``."""
    monkeypatch.chdir(tmp_path)

    def write(name: str = "free", time: str = "end = 3\nsamples = 49", rest: str = "", **tables: str) -> str:
        Path(f"{name}.toml").write_text(support.config(time=time, more=rest, name=name, **tables))
        return f"{name}.toml"

    return write


@pytest.fixture
def rigidsim_command() -> Callable[..., Any]:
    """Runs one command in this process."""

    def invoke(*arguments: str) -> Any:
        return CliRunner().invoke(app, list(arguments), prog_name="rigidsim")

    return invoke


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts ``python -m rigidsim`` as a process of its own; ended with the test."""
    started: list[subprocess.Popen[str]] = []

    def launch(*arguments: str, prelude: str = "") -> subprocess.Popen[str]:
        program = ["-m", "rigidsim"]
        if prelude:
            program = ["-c", f"{prelude}\nfrom rigidsim.cli.app import app\napp(prog_name='rigidsim')"]
        process = subprocess.Popen(
            [sys.executable, *program, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"CI": "1"},
        )
        started.append(process)
        return process

    yield launch
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()
