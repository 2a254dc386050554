"""The loads; importing this package registers all of their kinds."""

from __future__ import annotations

from rigidsim.model import sources  # noqa: F401  (names in expressions)
from rigidsim.model.load import Load, Term
from rigidsim.model.loads import (  # noqa: F401  (each enters its kinds; a new load is one line more here)
    applied,
    changing_tensor,
    gravity,
    hysteresis_rod,
    inner_bodies,
    magnetic_field,
    rigid_bodies,
    surface_load,
)
from rigidsim.model.si import InSI, in_si, seconds
from rigidsim.model.state_blocks import StateBlock

__all__ = ["ExtraStates", "InSI", "Load", "LoadModel", "StateBlock", "Term", "in_si", "seconds"]

LoadModel = Load
"""Former name of ``Load``, kept for loads written in Python."""

ExtraStates = StateBlock
"""Former name of ``StateBlock``, kept for loads written in Python."""
