"""Estimates of a run's errors, from better solutions or from neighbours of its motion."""
