"""Datasets in other tools' formats: one module each, which holds its ``FORMAT``."""

FORMATS = ("csv", "parquet", "zarr", "aem", "oem")
"""All formats, by the names of their modules, which are loaded on demand."""

FOR_SWEEPS = ("csv", "parquet", "zarr")
"""Formats that can hold more than a single motion."""
