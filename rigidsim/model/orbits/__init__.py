"""Paths of sources carried as states of the system: Kepler orbits, tables and point masses."""
