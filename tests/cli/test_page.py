"""Plain text on a pipe is what the terminal's library would print there, without loading it."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rigidsim.cli.screens.page import Page, console, page

LONG = "of the largest drift " * 20
WORD = "x" * 250
PRINTED: list[Callable[[Page], None]] = [
    lambda on: on.say(("tiny", "bold"), "  ", ("finished", "bold green")),
    lambda on: on.say(LONG),
    lambda on: on.say("a" * 30 + " " + WORD + " the end"),
    lambda on: on.say(LONG, whole=True),
    lambda on: on.say("[bold] is no markup, :smile: no picture"),
    lambda on: on.say(""),
    lambda on: on.line("folder", "runs/[bold]free"),
    lambda on: on.line("start", "body axes\n" + LONG + "\nlast"),
    lambda on: on.line("", WORD + " " + LONG, "bold red"),
    lambda on: on.line("examined", "20 µs, 3 °, 回転 of the body " + LONG),
    lambda on: on.table(
        ["invariant", "initial", "largest drift", "final"],
        [["energy", "1", ("2.2e-16", "red"), "-"], ["angular_momentum_norm", "|2.006|", "1e-16", "0.00e+00"]],
    ),
    lambda on: on.table(["states", "carried because"], [["wx wy wz", LONG], ["[q]", "read"]]),
    lambda on: on.table(["keys of [integrator]"], []),
]


@pytest.mark.parametrize("write", PRINTED)
def test_plain_text_is_as_the_library_prints_it(
    write: Callable[[Page], None], capsys: pytest.CaptureFixture[str]
) -> None:
    write(page())
    plain = capsys.readouterr().out.splitlines()
    write(page(console()))
    drawn = capsys.readouterr().out.splitlines()
    assert [line.rstrip() for line in plain] == [line.rstrip() for line in drawn]


def test_colours_are_given_to_who_asks_for_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    page().say(("finished", "bold green"))
    assert "\x1b[" in capsys.readouterr().out
