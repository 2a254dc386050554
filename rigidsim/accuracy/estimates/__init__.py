"""Estimates of a run's errors, from neighbours of its motion or from its closed form."""
