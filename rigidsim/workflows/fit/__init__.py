"""``rigidsim fit``: parameters of an experiment estimated from observations, and what these can't tell."""
