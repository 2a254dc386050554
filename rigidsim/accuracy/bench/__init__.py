"""Measuring how fast and how right the settings of one scene are."""
