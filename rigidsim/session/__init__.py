"""One session of a run: recording, guards, checkpoints, and the summary that it ends with."""
