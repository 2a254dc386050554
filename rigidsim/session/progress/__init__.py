"""How far a run is, while it goes on: here or in another terminal."""
