"""Frames beside the space and body axes: local, rotating and orbital ones, and planes of reference."""
