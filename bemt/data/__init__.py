"""A file becomes points with uncertainty: readers and recordings."""
