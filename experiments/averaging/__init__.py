"""Random bodies and orbits whose averaged motions are held against the full ones."""
