"""The user's description of a scene: typed config, units, bodies, loads, times, as exact numbers."""
