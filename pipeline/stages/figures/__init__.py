"""Figures and tables of the paper, one module each, and which of its claims were found."""
