"""Orbits given by tables of elements, and what is interpolated between their rows."""
