"""Files: segments, the labelled dataset, the run folder, provenance."""
