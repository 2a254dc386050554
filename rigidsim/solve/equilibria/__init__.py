"""Starts in an equilibrium, found by the scene's own equations: relative equilibria and Cassini states."""

from rigidsim.solve.equilibria import finding  # noqa: F401  (it enters them into rigidsim.scene.starts)
