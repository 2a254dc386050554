"""The command ``compare``."""

from pathlib import Path
from typing import Any

from rigidsim.cli.screens.compare import print_comparison
from rigidsim.cli.screens.page import answer
from rigidsim.workflows.compare.compared import compare as compared
from rigidsim.workflows.read import load


def compare(
    config: Path,
    file: Path,
    overrides: list[str] | None,
    convention: str | None,
    kernels: list[Path] | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Judge another tool's trajectory; options as in ``rigidsim.compare``."""
    given = load(config, overrides=overrides or [])
    asked = dict(part.strip().partition("=")[::2] for part in (convention or "").split(",") if part.strip())
    found = compared(given, file, convention=asked, kernels=kernels or (), **options)
    answer(as_json, found.as_dict(), print_comparison, found)
