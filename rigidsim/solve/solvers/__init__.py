"""The solvers; importing this package registers how they are asked for."""

from rigidsim.solve.solvers import (
    closed_form,  # noqa: F401
    taylor,  # noqa: F401  (a new solver is one line more here)
)
