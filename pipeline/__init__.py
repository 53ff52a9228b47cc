"""Experiments on precariously balanced rocks: configuration, stages, cache, cluster, report."""

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
"""The project's folder: configs/, data/raw/ and data/derived/ lie here."""
