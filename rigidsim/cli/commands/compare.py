"""The command ``compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rigidsim.cli.screens.page import Page, Styled, answer
from rigidsim.scene.readable import span_text
from rigidsim.workflows.compare.compared import Comparison
from rigidsim.workflows.compare.compared import compare as compared
from rigidsim.workflows.compare.evidence import AGREES, UNDECIDED
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


# --- output -------------------------------------------------------------------------------------------------

_MOST_UNDECIDED = 6


def print_comparison(found: Comparison) -> None:
    """Print the result of ``rigidsim compare``."""
    on = Page()
    on.say(
        (found.source, "bold"),
        f"  {found.rows:,} rows over {span_text(found.span_s)}, compared with {found.name}",
    )
    good = found.verdict in (AGREES, UNDECIDED)
    on.line("verdict", found.verdict, "bold" if good else "bold yellow")
    on.line("", found.why)
    on.line("written", f"{found.convention}, time in {found.convention.time_unit}")
    undecided = found.convention.undecided
    if undecided:
        more = f", and {len(undecided) - _MOST_UNDECIDED} more" if len(undecided) > _MOST_UNDECIDED else ""
        on.line("or", "; ".join(undecided[:_MOST_UNDECIDED]) + more + ": this motion can't decide")
    error = found.attitude_error
    rows: list[list[Styled]] = [
        [
            "attitude error",
            _angle(error.largest),
            f"{_angle(error.rms)} rms; at {error.time:.6g} s, {error.row}",
        ]
    ]
    if found.rate_error is not None:
        rows.append(["angular velocity", f"{found.rate_error:.3g} rad/s", ""])
    if found.position_error is not None:
        rows.append(["position", f"{found.position_error:.3g} m", ""])
    for drift in found.drifts:
        rows.append(
            [
                f"drift of {drift.name.replace('_', ' ')}",
                f"{drift.largest:.2g}",
                f"{drift.final:.2g} at the end",
            ]
        )
    if (local := found.local_defects) is not None:
        rows.append(
            [
                "local defect",
                _angle(local.largest),
                f"{_angle(local.rms)} rms; at {local.time:.6g} s, of {local.rows:,} rows",
            ]
        )
        if local.rate_largest is not None:
            rows.append(["  of the rates", f"{local.rate_largest:.3g} rad/s", ""])
        if local.unexplained is not None and local.window_s is not None:
            words = "of the attitude's that the rates' don't explain, over the rest"
            rows.append(
                [
                    "  share",
                    f"{local.unexplained:.2g}",
                    f"{words}, over spans of {span_text(local.window_s, 3)}",
                ]
            )
    on.table(["", "largest", ""], rows)
    if found.first_disagreement is not None:
        first = found.first_disagreement
        on.line("first", f"beyond {_angle(found.within)} at {first.time:.6g} s, {first.row}")
    on.lines("note", found.told)
    for label, name in (
        ("dataset", found.dataset_file),
        ("figure", found.figure_file),
        ("timeline", found.timeline_file),
    ):
        if name:
            on.line(label, name)


def _angle(angle: float) -> str:
    return f"{angle:.3g} rad"
