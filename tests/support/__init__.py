"""What several tests share: shapes, grounds, files and falls made up for them."""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"
"""Before NumPy is loaded: threads that share the small matrices of these tests only spin."""
