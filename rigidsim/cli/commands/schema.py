"""``rigidsim schema``: the config's JSON schema."""

from __future__ import annotations

import json


def schema() -> None:
    """Print the config's JSON schema, for editors.

    Example: rigidsim schema > rigidsim.schema.json; editors read the config's first line
    "#:schema rigidsim.schema.json"
    """
    from rigidsim.workflows.read import editor_schema

    print(json.dumps(editor_schema(), indent=2))
