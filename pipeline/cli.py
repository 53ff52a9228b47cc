"""The way into a command and out of it: its words are checked, then it runs, then its exit code."""

from __future__ import annotations

import argparse
import errno
import importlib
import os
import sys
import traceback
from contextlib import suppress
from pathlib import Path

from pipeline.config.problems import STAYS, InputError, Problem, Unfinished, edited_since
from pipeline.workflow.command_line import parsed
from pipeline.workflow.log import begin, complain, is_log, log
from vsr_core.errors import InvalidInput, reason

DONE, UNRESOLVED, REFUSED, BROKEN, STOPPED = 0, 1, 2, 3, 130

MAKING = ("run", "prep", "figures", "feasible", "replay", "join", "archive", "clean")
"""Commands after which the index of all results is updated."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command; returns the exit code.

    0 done; 1 some runs are unresolved, or not done as the scheduler was lost; 2 usage or input
    error; 3 internal error; 130 stopped by Ctrl-C or SIGTERM.
    """
    options = argparse.Namespace(verb="", derived=Path("data", "derived"))  # until they are read
    try:
        _check_current_folder()
        options = parsed(arguments)
        _begin_log(options)
        importlib.import_module("vsr_core.source.tracing").texts()  # before what they define
        commands = importlib.import_module("pipeline.commands").COMMANDS
        unresolved = commands[options.verb](options)
        if options.verb in MAKING:
            renew_index(options.derived)
        return UNRESOLVED if unresolved else DONE
    except InputError as error:
        return _refused(error)
    except InvalidInput as error:  # what no stage has blamed on a key
        return _refused(InputError.from_invalid(options.verb, "", error))
    except Unfinished as end:
        complain(f"vsr: {end}")
        return UNRESOLVED
    except BrokenPipeError:  # whoever read our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except KeyboardInterrupt:
        log(f"stopped; {STAYS}")
        return STOPPED
    except Exception as error:  # noqa: BLE001 (the last door: never a traceback on the screen)
        if known := _lacking(error) or _edited(error):
            return _refused(known)
        return _broken(options.derived)


def _broken(derived: Path) -> int:
    report = derived / "vsr-fault.txt"
    where = f"details in {report}"
    try:
        report.parent.mkdir(parents=True, exist_ok=True)
        report.write_text(traceback.format_exc(), encoding="utf-8", errors="backslashreplace")
    except OSError as unwritten:
        where = f"no details, because of {unwritten}"
    complain(f"vsr: internal error: {sys.exception()!r}; {where}")
    return BROKEN


def _lacking(error: Exception) -> InputError | None:
    """What of the machine there was too little of, if that is what was wrong."""
    number = getattr(error, "errno", 0)
    if isinstance(error, MemoryError) or number == errno.ENOMEM:
        rule, remedy = "a command has what it needs", "free some, or raise its limit (ulimit -v)"
        return InputError(Problem("memory", "", "too little of it", rule, remedy))
    if number in (errno.EMFILE, errno.ENFILE):
        rule, remedy = "a command may open some hundred", "raise the limit (ulimit -n)"
        return InputError(Problem("open files", "", "too few that are allowed", rule, remedy))
    return None


def _edited(error: Exception) -> InputError | None:
    """That code, or a page, is not what it was when first read, if that may be what was wrong."""
    for name in ("vsr_core.source.tracing", "pipeline.workflow.pages"):
        texts = sys.modules.get(name)
        with suppress(OSError):  # ones that cannot be read at all
            if edited := texts.edited() if texts else []:
                given = f"what was edited or moved while the command was at work ({error!r})"
                return edited_since(edited[0], given)
    return None


def _check_current_folder() -> None:
    try:
        Path.cwd()
    except FileNotFoundError:
        rule, remedy = "a command is given in a folder that exists", "cd to another"
        raise InputError(Problem(".", "", "a folder that was removed", rule, remedy)) from None


def _begin_log(options: argparse.Namespace) -> None:
    file: Path | None = options.log_file
    above = () if file is None else Path(os.path.realpath(file)).parents
    if results := next((folder for folder in above if (folder / ".stages").is_dir()), None):
        given, rule = f"{file}, which is in {results}", "a folder of results holds nothing else"
        raise InputError(Problem("--log-file", "", given, rule, "give another path"))
    try:
        if file is not None and file.exists() and not file.is_file():
            raise OSError(errno.EINVAL, "a pipe or a device, or a folder")
        if file is not None and not is_log(file):
            raise OSError(errno.EINVAL, "a file that is there and is no log")
        begin(quiet=options.quiet, file=file)
    except OSError as error:
        given, rule = f"{file}: {reason(error)}", "lines can be added to the file of a log"
        raise InputError(Problem("--log-file", "", given, rule, "give another path")) from error


def renew_index(derived: Path) -> None:
    """Renew the index of all results; what is wrong with it is told and decides nothing."""
    try:
        importlib.import_module("pipeline.workflow.front_page").renew(derived)
    except Exception as error:  # noqa: BLE001 (the command has done its work)
        complain(f"vsr: warning: index: not renewed ({reason(error)})")


def _refused(error: InputError) -> int:
    for problem in error.problems:
        complain(f"vsr: {problem}")
    return REFUSED
