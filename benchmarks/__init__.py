"""Performance benchmarks, as ratios within one run: ``make bench``."""
