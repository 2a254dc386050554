"""Measuring speed and accuracy of a scene's settings."""
