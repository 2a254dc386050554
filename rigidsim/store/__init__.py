"""Files on disk: segments, the labelled dataset, the run folder, provenance."""
