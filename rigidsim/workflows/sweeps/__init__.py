"""Sweeps: members of one experiment, checked, planned, and computed tile by tile, here or on a cluster."""
