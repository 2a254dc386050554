"""``rigidsim new``: commented configs to start from."""

from __future__ import annotations

from rigidsim.cli.screens.page import Page
from rigidsim.workflows.templates import described, write_new


def new(scene: str | None, name: str | None) -> None:
    """Write a template, or list them."""
    if scene is None:
        on = Page()
        on.table(["scene", "what it is"], described().items())
        on.say("rigidsim new SCENE [NAME] writes NAME.toml")
        return
    path = write_new(scene, name)
    print(f"{path}: edit it, then: rigidsim check {path}; rigidsim run {path}")
