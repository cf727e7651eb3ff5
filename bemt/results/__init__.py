"""Cases beside K1/K2, CFD and recordings: sweeps, grids and the report."""
