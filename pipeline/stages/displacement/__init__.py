"""From trajectories to the pages of large displacement."""
