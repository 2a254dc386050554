"""Sessions of a run: recording, guards, checkpoints, and the summary at the end."""
