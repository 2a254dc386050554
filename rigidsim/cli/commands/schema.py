"""``rigidsim schema``: the config's JSON schema."""

from __future__ import annotations

from rigidsim.cli.machine import print_json


def schema() -> None:
    """Print the config's JSON schema, for editors.

    Example: rigidsim schema > rigidsim.schema.json; editors read the config's first line
    "#:schema rigidsim.schema.json"
    """
    import rigidsim.workflows.read  # noqa: F401  (every kind of load is in the schema)
    from rigidsim.scene.editor_schema import editor_schema

    print_json(editor_schema(), indent=2)
