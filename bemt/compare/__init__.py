"""Models beside recordings: sweep, validation, grids, the thesis, benchmark."""
