"""Checks a built site as a reader finds it: every link leads somewhere, nothing comes from elsewhere."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

_FETCHED = {("script", "src"), ("img", "src"), ("link", "href"), ("iframe", "src"), ("source", "src")}
_FETCHED |= {("button", "data-recording")}
_FOREIGN = re.compile(r"""url\(\s*["']?((?:https?:)?//[^)"']+)|@import\s+["']((?:https?:)?//[^"']+)""")
_VIEWER = "re_viewer.js"
"""rerun's viewer would ask other hosts for a newer version, and tell them that it is used."""
_HELD = {"default-src": ["'none'"], "connect-src": ["'self'", "data:", "blob:"]}
"""What the browser must be told of a page with it."""


class _Page(HTMLParser):
    """What a page links, fetches, and can be linked at."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.anchors: set[str] = set()
        self.policy: dict[str, list[str]] = {}
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Called for each tag."""
        found = dict(attributes)
        if tag == "meta" and found.get("http-equiv") == "Content-Security-Policy":
            rules = (rule.split() for rule in (found.get("content") or "").split(";"))
            self.policy = {rule[0]: rule[1:] for rule in rules if rule}
        for name, value in attributes:
            if name == "id" and value:
                self.anchors.add(value)
            elif value and ((tag, name) in _FETCHED):
                self.fetched.append(value)
            elif value and tag == "a" and name == "href":
                self.links.append(value)


def faults(site: Path) -> list[str]:
    """Links that lead nowhere, and what would be fetched from another host."""
    pages = {path: _Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    found = []
    for path in sorted(site.rglob("*.css")):
        for match in _FOREIGN.finditer(path.read_text(encoding="utf-8")):
            found.append(f"{path.relative_to(site)}: fetches {match[1] or match[2]}")
    for path, page in pages.items():
        name = path.relative_to(site)
        if _VIEWER in page.fetched and not _HELD.items() <= page.policy.items():
            found.append(f"{name}: lets the viewer fetch from elsewhere")
        found += [f"{name}: fetches {url}" for url in page.fetched if _elsewhere(url)]
        for url in [*page.links, *page.fetched]:
            parts = urlsplit(url)
            if _elsewhere(url) or parts.scheme in ("mailto", "data"):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                found.append(f"{name}: {url} leads nowhere")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
                found.append(f"{name}: {url} names a place that isn't there")
    return found


def _elsewhere(url: str) -> bool:
    parts = urlsplit(url)
    return parts.scheme in ("http", "https") or bool(parts.netloc)
