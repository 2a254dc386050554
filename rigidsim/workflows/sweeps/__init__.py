"""Many members of one experiment: checked, planned, computed tile by tile, here or on a cluster."""
