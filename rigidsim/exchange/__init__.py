"""Datasets in the formats of other tools, one module each: CSV, Parquet, Zarr, CCSDS AEM and OEM."""
