"""Exit codes of commands that Ctrl-C ends, wherever it finds them."""

from __future__ import annotations

import pytest

from rigidsim.cli.ending import exit_code


def interrupted_as(kind: type[Exception]) -> int:
    """What a library does to Ctrl-C that comes while it works."""
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as signal:
        raise kind("initialization failed") from signal


def test_an_import_that_was_interrupted_is_an_interruption(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code(lambda: interrupted_as(ImportError)) == 130
    assert capsys.readouterr().err == "rigidsim: interrupted\n"


def test_what_goes_wrong_after_an_interruption_is_not_hidden() -> None:
    with pytest.raises(ValueError, match="initialization failed"):
        exit_code(lambda: interrupted_as(ValueError))


def test_a_library_that_cannot_be_loaded_is_not_an_interruption() -> None:
    def command() -> int:
        raise ImportError("no such library")

    with pytest.raises(ImportError, match="no such library"):
        exit_code(command)
