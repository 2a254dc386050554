"""How distant sources are placed: one class for each way, all of one protocol."""
