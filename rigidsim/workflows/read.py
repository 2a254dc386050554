"""Reading experiments with every kind of load and every observable known."""

from __future__ import annotations

import rigidsim.model.loads
import rigidsim.model.partial_invariants  # noqa: F401  (both enter what they define into rigidsim.scene.registry)
from rigidsim.scene.config import Experiment, load, parse
from rigidsim.scene.schema import config_model

__all__ = ["Experiment", "config_model", "load", "parse"]
