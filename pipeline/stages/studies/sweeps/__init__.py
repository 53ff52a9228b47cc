"""Comparisons of the members of a sweep."""
