"""Datasets in the formats of other tools: one module each, which holds its ``FORMAT``."""

FORMATS = ("csv", "parquet", "zarr", "aem", "oem")
"""All there are, by the names of their modules, which are loaded when they are asked for."""

FOR_SWEEPS = ("csv", "parquet", "zarr")
"""Those that hold more than a single motion."""
