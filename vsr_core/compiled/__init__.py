"""Compiled code: how it is made and kept, its records, and its vector algebra."""
