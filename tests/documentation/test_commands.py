"""Every command and link in the documentation is known to the program, its Makefile or the tree."""

from __future__ import annotations

import ast
import re
import shlex
import subprocess
import tomllib
from collections.abc import Callable
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import pytest
from conftest import Ran
from support.printed_commands import OPEN, PAGES, REFUSED, commands

from pipeline import ROOT, cli
from pipeline.config.layers import known, load_site
from pipeline.config.problems import InputError
from pipeline.workflow.command_line import parser

ELSEWHERE = ("podman", "git", ".venv/bin/dask", ".venv/bin/pre-commit", "apptainer", "sbatch", "cd")
"""Programs that are not ours: their command lines are not checked."""

VERBS = set(parser()._subparsers._group_actions[0].choices)


@cache
def extras() -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return set(project["optional-dependencies"])


def wrong(line: str) -> str:
    """What is wrong with a command line; nothing if it is right."""
    try:
        words = shlex.split(line, comments=True)
    except ValueError as error:
        return str(error)
    while words and re.fullmatch(r"[A-Z_]+=\S*", words[0]):  # the environment
        words = words[1:]
    if not words or words[0] in ELSEWHERE:
        return ""
    program = words[0].removeprefix(".venv/bin/")
    if program == "make":
        return wrong_make(words[1:])
    if program == "vsr":
        return wrong_vsr(words[1:])
    if program == "python":
        return wrong_python(words[1:])
    if program == "pip":
        asked = re.findall(r"\.\[(\w+)\]", line)
        return "" if asked and set(asked) <= extras() else "no such extra"
    return "" if (ROOT / words[0]).is_file() else f"{words[0]} is not there"


def wrong_make(words: list[str]) -> str:
    """What make would run is asked of make itself, which then runs nothing."""
    words = [word for word in words if not OPEN.search(word)]
    if not [word for word in words if "=" not in word]:
        return ""  # `make` alone
    done = subprocess.run(
        ["make", "-n", "-C", str(ROOT), *words], capture_output=True, text=True, check=False
    )
    if done.returncode:
        return done.stderr.strip()
    lines = done.stdout.replace("\\\n", " ").splitlines()
    asked = [line for line in lines if "-m pipeline" in line]
    found = (wrong_vsr(shlex.split(line.partition("-m pipeline")[2])) for line in asked)
    return next(filter(None, found), "")


def wrong_vsr(words: list[str]) -> str:
    """The program's own parser, and for a shipped site its own check of the configuration."""
    if len(words) == 1 or any(OPEN.search(word) for word in words):
        return "" if words[0] in {*VERBS, "--help"} else f"no command {words[0]}"
    try:
        options = vars(parser().parse_args(words))
    except InputError as error:
        return str(error)
    except SystemExit:
        return ""  # --help
    site, study = options.get("site"), options.get("study")
    if site in known() and not (study and study.endswith(".yaml")):
        try:
            load_site(site, None, tuple(options.get("settings", ())))
        except InputError as error:
            return str(error)
    return ""


def wrong_python(words: list[str]) -> str:
    if words[:1] != ["-m"]:
        return "" if words and (ROOT / words[0]).is_file() else f"{words[0]} is not there"
    path = ROOT / words[1].replace(".", "/")
    if words[1] == "pytest":
        gone = [word for word in words if "/" in word and "*" not in word]
        gone = [word for word in gone if word != "tests/faults/FILE" and not (ROOT / word).exists()]
        return f"{gone[0]} is not there" if gone else ""
    return "" if path.with_suffix(".py").is_file() or path.is_dir() else f"no module {words[1]}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_are_known(page: Path) -> None:
    found = {line: fault for line in commands(page) if (fault := wrong(line))}
    if page.name == "faq.md":  # whose commands are refused on purpose
        found = {line: fault for line, fault in found.items() if f"$ {line}" not in REFUSED}
    assert found == {}


def test_a_wrong_command_is_noticed() -> None:
    lines = (
        "make fragilty SITE=double_rock",
        "make fragility SIET=double_rock",
        "make fragility SITE=double_rock SET='yaww=3'",
        "vsr run nothing --site double_rock",
        ".venv/bin/vsr list --all",
        ".venv/bin/python -m benchmarks.nothing",
        ".venv/bin/pip install -e '.[nothing]'",
    )
    assert [line for line in lines if not wrong(line)] == []


def test_enough_commands_are_found() -> None:
    found = {page.name: len(list(commands(page))) for page in PAGES}
    assert found["README.md"] > 8
    assert found["tasks.md"] > 20
    assert found["quick_start.md"] > 4


@pytest.mark.parametrize(("command", "said"), REFUSED.items())
def test_errors_are_what_the_program_says(
    command: str, said: str, vsr: Callable[..., Ran], derived: Path
) -> None:
    ran = vsr(*shlex.split(command.removeprefix("$ vsr ")))
    assert ran.code == cli.REFUSED
    wanted = said.replace("[", "[[]").replace("...", "*")
    assert fnmatch(ran.err.strip().splitlines()[-1], wanted), ran.err


def test_scripts_of_the_gallery_say_what_they_show() -> None:
    scripts = [
        *(ROOT / "docs" / "gallery").glob("*.py"),
        *(ROOT / "docs" / "pictures").glob("*.py"),
    ]
    assert len(scripts) > 8
    for script in scripts:
        text = script.read_text(encoding="utf-8")
        assert ast.get_docstring(ast.parse(text)), script
        assert f'savefig("{script.stem}.png"' in text, script
