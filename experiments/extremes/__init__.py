"""Scenes at the edge of what numbers hold, and what each formulation makes of them."""
