"""Motions with kinks and jumps: steps that end on switching surfaces, and what goes on along them."""
