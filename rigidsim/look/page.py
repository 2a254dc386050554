"""The summary page (markdown) that stands beside the pictures."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.look.plots import pretty_unit
from rigidsim.look.readable_time import TimeWords
from rigidsim.look.roles import drifts

if TYPE_CHECKING:
    from rigidsim.look.rows import Table, Variable


def read_config(dataset: Table) -> dict[str, Any]:
    """The embedded config as a dictionary; empty when there is none or it can't be read."""
    try:
        return tomllib.loads(str(dataset.attrs.get("config", "")))
    except tomllib.TOMLDecodeError:
        return {}


def title_of(dataset: Table) -> str:
    """Title of the run: attribute `title`, else the config's name."""
    return str(dataset.attrs.get("title") or read_config(dataset).get("name") or "rigid body")


def summary_page(dataset: Table, thinned: Table, notes: list[str]) -> str:
    """Markdown: what was run, what was conserved, how the picture is scaled, the config.

    Args:
        dataset: the whole dataset (only its attributes and sizes are read).
        thinned: its rows as shown, in memory.
        notes: lines about the picture, such as scales.
    """
    config = read_config(dataset)
    integrator = config.get("integrator", {})
    lines = [f"# {title_of(dataset)}", ""]
    if config.get("description"):
        lines += [str(config["description"]).strip(), ""]
    facts = [
        ("name", config.get("name")),
        ("formulation", dataset.attrs.get("formulation") or integrator.get("formulation")),
        ("precision", dataset.attrs.get("precision") or integrator.get("precision")),
        ("status", dataset.attrs.get("status")),
        ("span", _span(dataset, thinned)),
        ("samples", _samples(dataset, thinned)),
        ("steps", dataset.attrs.get("steps")),
    ]
    lines += _table(("run", ""), [(k, str(v)) for k, v in facts if v not in (None, "")])
    invariants = _invariants(thinned)
    if invariants:
        complete = dataset.sizes["time"] == thinned.sizes["time"]
        drift = "largest drift" if complete else "largest drift of the rows shown"
        lines += _table(("invariant", "initial", drift), invariants)
    lines += ["## Picture", "", *(f"- {note}" for note in notes), ""]
    text = str(dataset.attrs.get("config", "")).strip()
    if text:
        lines += ["## Config", "", "```toml", text, "```", ""]
    return "\n".join(lines)


def largest_drift(variable: Variable) -> float:
    """Largest magnitude of a drift over the rows given; NaN when there is none that is finite."""
    magnitude = np.abs(np.asarray(variable.values, dtype=np.float64))
    magnitude = magnitude[np.isfinite(magnitude)]
    return float(magnitude.max()) if magnitude.size else float("nan")


def _invariants(thinned: Table) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for base, drift in drifts(thinned).items():
        initial = ""
        if base in thinned:
            value = np.asarray(thinned[base].values[0]).ravel()
            unit = pretty_unit(str(thinned[base].attrs.get("units", "")))
            initial = (", ".join(f"{v:.6g}" for v in value) + f" {unit}").rstrip()
        rows.append((base.replace("_", " "), initial, f"{largest_drift(drift):.2e}"))
    return rows


def _span(dataset: Table, thinned: Table) -> str:
    start, end = (float(thinned["time"].values[i]) for i in (0, -1))
    words = TimeWords.of(dataset.attrs, start, end)
    return f"{words.moment(start)} to {words.moment(end)}"


def _samples(dataset: Table, thinned: Table) -> str:
    total, shown = dataset.sizes["time"], thinned.sizes["time"]
    return f"{total:,}" if total == shown else f"{total:,}, shown {shown:,}"


def _cell(value: object) -> str:
    return str(value).replace("|", "\\|").replace("\n", " ")


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    rule = "| " + " | ".join("---" for _ in head) + " |"
    return [
        "| " + " | ".join(head) + " |",
        rule,
        *("| " + " | ".join(_cell(cell) for cell in row) + " |" for row in rows),
        "",
    ]
