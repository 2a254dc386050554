"""How wrong an averaged model is, and which one is good enough."""
