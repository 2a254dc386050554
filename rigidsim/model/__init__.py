"""Symbolic mechanics in heyoka expressions: the least system that a scene needs."""
