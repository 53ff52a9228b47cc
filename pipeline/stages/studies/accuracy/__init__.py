"""Error of the boundary against run time."""
