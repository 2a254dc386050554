"""What the user described: typed config, units, bodies, loads, times, as exact numbers."""
