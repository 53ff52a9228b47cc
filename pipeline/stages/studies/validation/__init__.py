"""Predictions of recorded shake-table tests, beside their outcomes."""
