"""Parameter grids, chunk by chunk: on this machine or a Dask cluster, CSV or Parquet (`run` joins them)."""
