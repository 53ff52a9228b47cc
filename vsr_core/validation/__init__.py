"""Predictions of recorded shake-table tests: what is not known, an ensemble over it, and scores."""
