"""Sections of the gallery, made from the comments of the ready configs when the site is built."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = [
    config
    for folder in ("", "bodies", "tables")
    for config in sorted((ROOT / "configs" / folder).glob("*.toml"))
]
MARKER = "<!-- a section for each scene -->"
_STUDIED = ("apophis_flyby", "flip_sphere", "round_off")  # sweeps with a picture by their study


def with_sections(text: str) -> str:
    """The gallery's page with a section for each config, in place of the marker."""
    parts = [f"## {config.stem}\n\n{_scene(config)}" for config in CONFIGS]
    swept = sorted((ROOT / "configs" / "sweeps").glob("*.toml"))
    return text.replace(MARKER, "\n\n".join([*parts, "## Sweeps", *map(_sweep, swept)]))


def _scene(config: Path) -> str:
    """Description, remarks and both pictures of a config."""
    look = _comment(config)
    look = look.partition("What to look for: ")[2] or look
    drawn = f"figures/gallery/{config.stem}"
    return "\n\n".join(
        [
            _title(config),
            look[:1].upper() + look[1:],
            f"![Its timeline]({drawn}_timeline.png)",
            f"![Figure drawn by rigidsim plot]({drawn}.png)",
        ]
    )


def _sweep(config: Path) -> str:
    drawn_by = "its study" if config.stem in _STUDIED else "rigidsim plot"
    return f"{_title(config)}\n\n![Figure drawn by {drawn_by}](figures/{config.stem}.png)"


def _title(config: Path) -> str:
    description = tomllib.loads(config.read_text(encoding="utf-8")).get("description", "")
    return f"*{description}.* [{config.name}](../{config.relative_to(ROOT).as_posix()})"


def _comment(config: Path) -> str:
    """The comment at the head of a config, in one line."""
    found = re.match(r"(?:#[^\n]*\n)+", config.read_text(encoding="utf-8"))
    return " ".join(line.lstrip("#").strip() for line in found[0].splitlines()) if found else ""
