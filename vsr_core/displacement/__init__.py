"""Statistics of large displacement, and the way back from a found rock."""
