"""Parameter grids, chunk by chunk: on this machine or a Dask cluster, as CSV (`run` joins them)."""
