"""Progress of a run while it goes on, here or in another terminal."""
