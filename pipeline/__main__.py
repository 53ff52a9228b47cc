"""``python -m pipeline``, also installed as ``vsr``."""

import gc
import os
import signal
import sys
from io import TextIOWrapper
from pathlib import Path
from threading import Timer, get_ident
from types import FrameType

from pipeline.cli import main
from pipeline.workflow.log import tell_warnings_once

COLLECTED_AFTER = 100_000
"""Objects made between two searches for rings of garbage, of which there is little here: Python's
own 700 make it search all that is loaded again and again, a sixth of a command of seconds."""


def program() -> int:
    """The process of one command; returns its exit code."""
    gc.set_threshold(COLLECTED_AFTER, 20, 20)
    for stops in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(stops) is signal.SIG_DFL:  # nohup has it ignored
            signal.signal(stops, _stop)
    sys.unraisablehook = _stop_again
    os.environ["MPLBACKEND"] = "agg"  # pictures go to files, whatever screen there is
    os.environ.pop("SOURCE_DATE_EPOCH", None)  # no file has a date, and of no number libraries fail
    if sys.stderr is None:  # closed: what is told goes nowhere
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 (till the end)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a name that this terminal cannot show
    tell_warnings_once()
    code = main()
    gc.freeze()  # else all objects are searched once more at the end, for most of a second
    return code


def _stop(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _stop_again(ignored: "sys.UnraisableHookArgs") -> None:
    """Stop a moment later where Ctrl-C or SIGTERM met a callback, whose errors Python ignores."""
    if issubclass(ignored.exc_type, KeyboardInterrupt):
        Timer(0.05, signal.pthread_kill, (get_ident(), signal.SIGTERM)).start()
    else:
        sys.__unraisablehook__(ignored)


if __name__ == "__main__":
    sys.exit(program())
