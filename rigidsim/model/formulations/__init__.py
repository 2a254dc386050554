"""Formulations of the rotation, one file each; importing this package registers them."""

from rigidsim.model.formulations import (  # noqa: F401  (each enters itself; a new one is one line more here)
    averaged,
    canonical,
    euler_angles,
    plain,
    planar,
)
