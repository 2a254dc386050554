"""Orbits given by tables of elements, and the interpolation between their rows."""
