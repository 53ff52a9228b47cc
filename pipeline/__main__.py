"""``python -m pipeline``, also installed as ``vsr``."""

import gc
import sys

from pipeline.cli import main

COLLECTED_AFTER = 100_000
"""Objects made between two searches for rings of garbage, of which there is little here: Python's
own 700 make it search all that is loaded again and again, a sixth of a command of seconds."""


def program() -> int:
    """The process of one command; returns its exit code."""
    gc.set_threshold(COLLECTED_AFTER, 20, 20)
    code = main()
    gc.freeze()  # else all objects are searched once more at the end, for most of a second
    return code


if __name__ == "__main__":
    sys.exit(program())
