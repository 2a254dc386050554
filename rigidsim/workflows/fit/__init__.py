"""``rigidsim fit``: parameters of an experiment estimated from observations, and what stays undetermined."""
