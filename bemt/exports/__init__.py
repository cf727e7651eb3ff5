"""Command ``export``: a case as solids, surfaces and OpenFOAM cases (`command` joins them)."""
