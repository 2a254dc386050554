"""The usual arguments of ``run``, read without typer: always as typer would read them."""

from __future__ import annotations

import inspect
from typing import Any

import pytest
import typer.main

from rigidsim.cli.app import program
from rigidsim.cli.plain_run import plain
from rigidsim.cli.running import run_all

DEFAULTS = {name: parameter.default for name, parameter in inspect.signature(run_all).parameters.items()}


def read_by_typer(arguments: list[str]) -> dict[str, Any]:
    commands = typer.main.get_command(program(["run"])).commands  # type: ignore[attr-defined]
    return dict(commands["run"].make_context("run", list(arguments)).params)


@pytest.mark.parametrize(
    "arguments",
    [
        ["a.toml"],
        ["a.toml", "b c.toml", "../d.toml"],
        ["--out", "some where", "a.toml", "--force"],
        ["a.toml", "--set", "time.end=1", "--json", "b.toml", "--set", "name=x y"],
        ["--json", "--json", "a.toml", "--out", "x", "--out", "y"],
        ["--set", "", "a.toml"],
        ["ä.toml", "--set", "description=ö"],
    ],
    ids=" ".join,
)
def test_it_reads_what_typer_reads(arguments: list[str]) -> None:
    usual = plain(["run", *arguments])
    assert usual is not None
    read = read_by_typer(arguments)
    assert set(read) == set(DEFAULTS)
    assert {**DEFAULTS, **usual} == {
        name: value if value not in ([], ()) else None for name, value in read.items()
    }


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["run"],
        ["run", "--help"],
        ["run", "a.toml", "-h"],
        ["run", "a.toml", "--out"],
        ["run", "a.toml", "--set", "--force"],
        ["run", "a.toml", "--set=time.end=1"],
        ["run", "a.toml", "--forc"],
        ["run", "a.toml", "--sweep", "time.end=[1,2]"],
        ["run", "--from", "dataset.h5"],
        ["run", "--force"],
        ["run", "--", "-a.toml"],
        ["run", ""],
        ["check", "a.toml"],
        ["--version"],
    ],
    ids=" ".join,
)
def test_anything_else_is_left_to_typer(arguments: list[str]) -> None:
    assert plain(arguments) is None


def test_completion_is_left_to_typer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("_RIGIDSIM_COMPLETE", "complete_bash")
    assert plain(["run", "a.toml"]) is None
