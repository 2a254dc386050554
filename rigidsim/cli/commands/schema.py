"""``rigidsim schema``: the config's JSON schema."""

from __future__ import annotations

import json


def schema() -> None:
    """Print the config's JSON schema, for editors.

    Example: rigidsim schema > rigidsim.schema.json
    """
    from rigidsim.workflows.read import config_model

    print(json.dumps(config_model().model_json_schema(), indent=2))
