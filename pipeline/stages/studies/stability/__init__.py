"""Stiff and extreme cases, each with its verdict."""
