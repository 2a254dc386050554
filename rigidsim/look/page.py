"""The summary page (markdown) beside the pictures."""

import re

import numpy as np
import xarray

from rigidsim.look.plots import pretty_unit
from rigidsim.look.signals import by_role, in_words, is_averaged, read_config, title_of
from rigidsim.scene.readable import TimeWords


def summary_page(dataset: xarray.Dataset, thinned: xarray.Dataset) -> str:
    """Markdown page, short enough to be seen whole: what was run, and what was conserved."""
    config = read_config(dataset)
    integrator = config.get("integrator", {})
    attributes = dataset.attrs
    said = str(config.get("description") or "").strip().replace("\n", " ")
    heading = f"**{title_of(dataset)}**" + (f": {said}" if said else "")
    ended = str(attributes.get("status") or "")
    status = ended.replace("_", " ")
    if ended not in ("", "finished") and attributes.get("status_message"):
        status = str(attributes["status_message"])
    start, end = (float(thinned["time"].values[i]) for i in (0, -1))
    words = TimeWords.of(attributes, start, end)
    total = dataset.sizes["time"]
    complete = total == thinned.sizes["time"]
    kind = "model" if is_averaged(attributes) else "formulation"
    facts = [
        ("span", f"{words.moment(start)} to {words.moment(end)}"),
        ("samples", f"{total:,}" if complete else f"{total:,}, shown {thinned.sizes['time']:,}"),
        ("steps", attributes.get("steps")),
        ("precision", attributes.get("precision") or integrator.get("precision")),
        (kind, attributes.get("formulation") or integrator.get("formulation")),
        ("status", status),
    ]
    if "attitude_error" in attributes:
        what = "axis integrated to" if is_averaged(attributes) else "attitude uncertain by"
        facts.append((what, f"{float(attributes['attitude_error']):.2g} rad"))
    if "modelling_error" in attributes:
        facts.append(("from the full model", f"{float(attributes['modelling_error']):.2g} rad"))
    facts = [(name, value) for name, value in facts if value not in (None, "")]
    fitted = [f"fit: {attributes['fit']}", ""] if attributes.get("fit") else []
    lines = [
        heading,
        "",
        *fitted,
        *_table(tuple(name for name, _ in facts), [tuple(str(v) for _, v in facts)]),
    ]
    invariants = _invariants(thinned)
    if invariants:
        drift = "largest drift" if complete else "largest drift of the rows shown"
        # across, not down: a page that must be scrolled isn't read
        names, initial, largest = zip(*invariants, strict=True)
        rows = [("initial", *initial)] if any(initial) else []  # none of their values was recorded
        rows.append((drift, *largest))
        lines += _table(("invariant", *names), rows)
    return legible("\n".join(lines))


def notes_page(kind: str, notes: list[str]) -> str:
    """Markdown page: what the picture shows, and how it is scaled."""
    return legible("\n".join([f"**Picture: {kind}**", "", *(f"- {note}" for note in notes), ""]))


def config_page(dataset: xarray.Dataset) -> str:
    """Markdown page of the config that was run; empty if there is none."""
    text = str(dataset.attrs.get("config", "")).strip()
    return legible("\n".join(["```toml", text, "```", ""])) if text else ""


def legible(text: str) -> str:
    """The text with characters that the viewer has glyphs for; it aborts on others (0.41, Inter alone)."""
    return _WITHOUT_GLYPH.sub("?", text)


# What Inter has of the blocks that texts about motion use; what lies outside is written as a question mark.
_GLYPHS = (
    (0x20, 0x7E), (0xA0, 0x148), (0x14A, 0x1C3), (0x1C5, 0x31E), (0x384, 0x38A), (0x38E, 0x3A1),
    (0x3A3, 0x3E1), (0x3F0, 0x49D), (0x4A0, 0x4FF), (0x1E00, 0x1EFF), (0x2000, 0x200A), (0x2010, 0x2027),
    (0x2030, 0x205E), (0x2074, 0x208E), (0x2090, 0x209C), (0x20A0, 0x20BF), (0x2190, 0x2199),
)  # fmt: skip
_SINGLE = "\n\t²³−√∞≈≠≤≥∂∆∏∑∫■▲▼◆●○◊"
_RANGES = "".join(f"{re.escape(chr(low))}-{re.escape(chr(high))}" for low, high in _GLYPHS)
_WITHOUT_GLYPH = re.compile(f"[^{_SINGLE}{_RANGES}]")


def largest_drift(variable: xarray.DataArray) -> float:
    """Largest magnitude of a drift over the given rows; NaN if none is finite."""
    magnitude = np.abs(np.asarray(variable.values, dtype=np.float64))
    magnitude = magnitude[np.isfinite(magnitude)]
    return float(magnitude.max()) if magnitude.size else float("nan")


def _invariants(thinned: xarray.Dataset) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for base, drift in by_role(thinned, "drift_of").items():
        initial = ""
        if base in thinned:
            value = np.asarray(thinned[base].values[0]).ravel()
            unit = pretty_unit(str(thinned[base].attrs.get("units", "")))
            initial = (", ".join(f"{v:.6g}" for v in value) + f" {unit}").rstrip()
        rows.append((in_words(base), initial, f"{largest_drift(drift):.2e}"))
    return rows


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    told = [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in rows]
    return [*(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *told)), ""]
