"""Gathers the pages of the site: those of docs/, the guide to the studies, the changelog, the notebooks.

Pages link each other by paths within the repository, so that they read as well there. Here each link is
followed: to a page or a picture it becomes the place of that in the site, to a file that the site has no page
for a download; a folder or a module is named without a link, and what isn't there is an error.
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import notebooks
import scenes
import sections

ROOT = Path(__file__).resolve().parents[2]
ELSEWHERE = {
    "CHANGELOG.md": "changelog.md",
    "experiments/README.md": "experiments/index.md",
}
"""Pages outside docs/, by their place in the site."""
_FIRST = {"README.md": "index.md"}  # links to it lead to docs/index.md, with which the site begins
_LINK = re.compile(r"(?<!`)(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")
_FENCE = re.compile(r"^(```.*?^```$)", re.MULTILINE | re.DOTALL)
_ENTRY = re.compile(r"\]\(([\w/.-]+\.md)\)|^- `(reference/[\w.]+\.md)`", re.MULTILINE)


class DeadLinkError(Exception):
    """A page links what isn't there."""


def gather(folder: Path, root: Path = ROOT, *, run: bool = False) -> list[Path]:
    """Write all pages, with what they show, into a folder.

    Args:
        root: of the repository.
        run: whether to run the notebooks and to show what comes of them, and scenes play.

    Returns:
        The pages, without those that are generated.

    Raises:
        DeadLinkError: with all dead links of all pages.
    """
    found = [*sources(root / "docs"), *(root / name for name in ELSEWHERE)]
    pages = {page: str(place_of(page, root)) for page in found}
    dead: list[str] = []
    for page, place in pages.items():
        target = folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if page.suffix == ".ipynb":
            text = notebooks.as_page(page, target.parent / "pictures" if run else None)
        else:
            text = sections.with_sections(page.read_text(encoding="utf-8"))
        if run and place in scenes.PAGES:
            text = scenes.with_buttons(text)
        target.write_text(_linked(text, page, folder, root, dead), encoding="utf-8")
    if dead:
        raise DeadLinkError("\n".join(dead))
    return [folder / place for place in pages.values()]


def place_of(path: Path, root: Path) -> str | None:
    """Where a file of the repository lies in the site; None for what has no place of its own."""
    if not path.is_relative_to(root):
        return None
    name = path.relative_to(root).as_posix()
    if name in _FIRST or name in ELSEWHERE:
        return (_FIRST | ELSEWHERE)[name]
    if path.is_relative_to(root / "docs"):
        page = path.relative_to(root / "docs")
        return str(page.with_suffix(".md" if path.suffix == ".ipynb" else path.suffix))
    return name if path.suffix in (".png", ".toml", ".gif") else None


def add_contents(folder: Path) -> None:
    """Give the first page a table of contents, section by section as it lists the pages; pages that it
    doesn't name come last.
    """
    index = folder / "index.md"
    text = index.read_text(encoding="utf-8")
    listed: set[str] = {"index.md"}
    made = []
    for section in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        names = [link or generated for link, generated in _ENTRY.findall(section)]
        names = [name for name in dict.fromkeys(names) if name not in listed]
        listed |= set(names)
        if names:
            made.append(_toctree(section.partition("\n")[0], names))
    rest = sorted(str(page.relative_to(folder)) for page in folder.rglob("*.md"))
    rest = [name for name in rest if name not in listed]
    text = re.sub(
        r"^- `(reference/[\w.]+\.md)`", lambda found: _titled(folder, found[1]), text, flags=re.MULTILINE
    )
    made += [_toctree("More", rest)] if rest else []
    index.write_text("\n\n".join([text.rstrip(), *made]) + "\n", encoding="utf-8")


def _titled(folder: Path, name: str) -> str:
    """An entry for a page that is made from the code, by its title."""
    title = (folder / name).read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
    return f"- [{title}]({name})"


def _toctree(caption: str, names: list[str]) -> str:
    entries = "\n".join(name.removesuffix(".md") for name in names)
    return f"```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{entries}\n```"


def sources(folder: Path) -> list[Path]:
    """The pages and notebooks below a folder, without those of a site that was built into it before."""
    found = [*sorted(folder.rglob("*.md")), *sorted(folder.rglob("*.ipynb"))]
    return [page for page in found if not any(p.startswith("_") for p in page.relative_to(folder).parts)]


def _linked(text: str, page: Path, folder: Path, root: Path, dead: list[str]) -> str:
    """The text with its links as they are in the site; code is left as it is."""
    place = Path(str(place_of(page, root)))

    def replaced(found: re.Match[str]) -> str:
        picture, words, target = found.groups()
        name, hash_, anchor = target.partition("#")
        if "://" in target or target.startswith("mailto:") or not name:
            return found[0]
        path = Path(os.path.normpath(page.parent / name))
        if not path.exists():
            dead.append(f"{page.relative_to(root)}: [{words}]({target}) leads nowhere")
            return found[0]
        there = place_of(path, root)
        if path.suffix == ".ipynb" and page == path:
            there = str(path.relative_to(root / "docs"))
        if there is None or path.is_dir():
            return words if "`" in words else f"`{words}`"
        if path.suffix not in (".md", ".ipynb") or page == path:
            (folder / there).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, folder / there)
        way = os.path.relpath(there, place.parent)
        return f"{picture}[{words}]({way}{hash_}{anchor})"

    parts = _FENCE.split(text)
    return "".join(part if n % 2 else _LINK.sub(replaced, part) for n, part in enumerate(parts))
