"""Neighbouring motions, carried along to learn how a run's errors grow."""
