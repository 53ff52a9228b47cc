"""The overturning boundary between the cells of a grid, resolved by runs of its own."""
