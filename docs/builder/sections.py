"""Sections of the gallery and of published bodies, made from their TOML files when the site is built."""

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
BODIES = sorted((ROOT / "rigidsim" / "scene" / "bodies" / "published").glob("*.toml"))
_STUDIED = ("apophis_flyby", "flip_sphere", "round_off")  # sweeps with a picture by their study


def with_sections(text: str) -> str:
    """A page with a section for each scene or body, in place of its marker; above the scenes small pictures
    that lead to them.
    """
    small = [f"[![{one.stem}](figures/gallery/{one.stem}_timeline.png)](#{one.stem})" for one in CONFIGS]
    scenes = ["```{{container}} thumbnails\n{}\n```".format("\n".join(small))]
    scenes += [f"## {config.stem}\n\n{_scene(config)}" for config in CONFIGS]
    scenes += ["## Sweeps", *map(_sweep, sorted((ROOT / "configs" / "sweeps").glob("*.toml")))]
    bodies = [f"## {body.stem}\n\n{_body(body)}" for body in BODIES]
    text = text.replace("<!-- a section for each scene -->", "\n\n".join(scenes))
    return text.replace("<!-- a section for each body -->", "\n\n".join(bodies))


def _body(body: Path) -> str:
    """Remarks on a published body, from the comment at the head of its file, and its values."""
    values = body.read_text(encoding="utf-8").partition("\n\n")[2].strip()
    return f"{_comment(body)}\n\n```toml\n{values}\n```"


def _scene(config: Path) -> str:
    """Description, remarks and both pictures of a config."""
    look = _comment(config)
    look = look.partition("What to look for: ")[2] or look
    drawn = f"figures/gallery/{config.stem}"
    film = f"figures/films/{config.stem}.gif"
    return "\n\n".join(
        [
            _title(config),
            look[:1].upper() + look[1:],
            *([f"![Four seconds of it]({film})"] if (ROOT / "docs" / film).exists() else []),
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
