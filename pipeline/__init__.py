"""Experiments on precariously balanced rocks: configuration, stages, cache, cluster, report."""

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
"""The folder of the packages: the checkout, or where they are installed."""
