"""Figures: one a module, each a function from datasets to a matplotlib figure."""
