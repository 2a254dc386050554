"""The loads, one file each; importing this package enters all of them into the registry of kinds."""

from __future__ import annotations

from rigidsim.model.kinematics import seconds
from rigidsim.model.load import Load, Term
from rigidsim.model.loads import (  # noqa: F401  (each enters its kind; a new load is one line more here)
    applied,
    central_gravity,
    gravity_gradient,
    magnetic_dipole,
    uniform_gravity,
    viscous_torque,
)
from rigidsim.model.state_blocks import StateBlock

__all__ = ["ExtraStates", "Load", "LoadModel", "StateBlock", "Term", "seconds"]

LoadModel = Load
"""The name by which loads of one's own were first derived."""

ExtraStates = StateBlock
"""The name by which their states were first given."""
