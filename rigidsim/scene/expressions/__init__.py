"""Expressions of time, the state and parameters: how they are written, and what they mean."""
