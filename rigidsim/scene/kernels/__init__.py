"""Positions of real bodies: kernels of ephemerides, and what a scene sees of them."""
