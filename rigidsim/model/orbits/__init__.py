"""Paths of sources as states of the system: Kepler orbits, tables and point masses."""
