"""Expressions of time, the state and parameters: syntax and meaning."""
