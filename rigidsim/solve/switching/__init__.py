"""Motions with kinks and jumps: steps that end on switching surfaces, and sliding along them."""
