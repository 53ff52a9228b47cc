"""``python -m pipeline``, also installed as ``vsr``."""

import sys

from pipeline.cli import main

if __name__ == "__main__":
    sys.exit(main())
