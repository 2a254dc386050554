"""Frames besides the space and body axes: local, rotating and orbital ones, and reference planes."""
