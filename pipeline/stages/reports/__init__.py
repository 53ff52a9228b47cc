"""The fragility report of a site."""
