"""The summary page (markdown) beside the pictures."""

import re

import xarray

from rigidsim.look.pages import numbers
from rigidsim.look.record import read_config
from rigidsim.look.signals import title_of
from rigidsim.scene.readable import TimeWords


def summary_page(dataset: xarray.Dataset, thinned: xarray.Dataset) -> str:
    """Markdown page, short enough to be seen whole: what was run, and the motion's own numbers."""
    said = str(read_config(dataset).get("description") or "").strip().replace("\n", " ")
    attributes = dataset.attrs
    start, end = (float(thinned["time"].values[i]) for i in (0, -1))
    words, total = TimeWords.of(attributes, start, end), dataset.sizes["time"]
    shown = "" if total == thinned.sizes["time"] else f", shown {thinned.sizes['time']:,}"
    facts = [("span", f"{words.moment(start)} to {words.moment(end)}"), ("samples", f"{total:,}{shown}")]
    ended = str(attributes.get("status") or "")
    if ended not in ("", "finished"):
        facts.append(("status", str(attributes.get("status_message") or ended.replace("_", " "))))
    heading = f"**{title_of(dataset)}**" + (f": {said}" if said else "")
    fitted = [f"fit: {attributes['fit']}", ""] if attributes.get("fit") else []
    # across, not down: a page that must be scrolled isn't read
    tables = [_table(found) for found in (facts, numbers(thinned)) if found]
    return legible("\n".join([heading, "", *fitted, *(line for table in tables for line in table)]))


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


def _table(found: list[tuple[str, str]]) -> list[str]:
    names, texts = zip(*found, strict=True)
    rows = [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in (names, texts)]
    rows.insert(1, ["---"] * len(found))
    return [*(f"| {' | '.join(cells)} |" for cells in rows), ""]
