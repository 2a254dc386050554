"""The command ``compare``."""

from pathlib import Path

from rigidsim.cli.screens.compare import print_comparison
from rigidsim.cli.screens.page import answer
from rigidsim.workflows.compare.compared import compare as compared
from rigidsim.workflows.read import load


def compare(
    config: Path, file: Path, overrides: list[str] | None, within: float, out: Path | None,
    figure: Path | None, timeline: Path | None, kernels: list[Path] | None, force: bool, as_json: bool,
) -> None:  # fmt: skip
    """Judge another tool's trajectory."""
    given = load(config, overrides=overrides or [])
    found = compared(
        given, file, within=within, out=out, figure=figure, timeline=timeline, kernels=kernels or (),
        force=force,
    )  # fmt: skip
    answer(as_json, found.as_dict(), print_comparison, found)
