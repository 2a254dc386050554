"""Datasets in other tools' formats."""

FORMATS = ("csv", "parquet", "zarr", "aem", "apm", "oem", "ck", "pck", "snvec", "la2004")
"""All formats."""

FOR_SWEEPS = ("csv", "parquet", "zarr")
"""Formats that can hold more than a single motion."""
