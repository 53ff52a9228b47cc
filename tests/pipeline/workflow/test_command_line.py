"""What the help tells of commands and products, held against what the program takes."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable, Iterator

import pytest
from conftest import Ran

from pipeline import ROOT
from pipeline.config.layers import known, load_site
from pipeline.stages.mesh.originals import ORIGINALS
from pipeline.workflow.command_line import ANSWERS, parsed, parser
from pipeline.workflow.products import DELIVERABLES

COMMANDS: dict[str, argparse.ArgumentParser] = parser()._subparsers._group_actions[0].choices  # type: ignore[assignment, union-attr]

OF_SOME = ("--table", "--curves", "--events", "--age", "--age-sd")


def examples(text: str) -> Iterator[list[str]]:
    """Words of the commands below the options of a help."""
    for line in text.splitlines():
        if line.startswith("  vsr "):
            yield shlex.split(line)[1:]


def see_that_it_is_taken(words: list[str]) -> None:
    options = vars(parsed(words))
    if options.get("site") in known():
        load_site(options["site"], None, tuple(options["settings"]))


@pytest.mark.parametrize("product", DELIVERABLES)
def test_help_of_a_product_is_its_own(product: str, vsr: Callable[..., Ran]) -> None:
    said = vsr("run", product, "--help").out
    wanted = DELIVERABLES[product]
    assert wanted.about in " ".join(said.split())
    shown = [option for option in OF_SOME if f"  {option} " in said]
    assert shown == [option for option in OF_SOME if option[2:] in wanted.options]
    assert ("  --site " in said) == (product != "validation")
    (words,) = examples(said)
    assert words[:2] == ["run", product]
    see_that_it_is_taken(words)


def test_help_of_run_is_of_all_products_wherever_none_stands_before_it(
    vsr: Callable[..., Ran],
) -> None:
    said = vsr("run", "--help", "fragility").out
    assert [option for option in OF_SOME if f"  {option} " not in said] == []
    assert [name for name in DELIVERABLES if f"\n  {name} " not in said] == []


@pytest.mark.parametrize("command", COMMANDS)
def test_every_word_of_a_command_has_its_help_and_there_is_an_example(command: str) -> None:
    sub = COMMANDS[command]
    assert [action.dest for action in sub._actions if not action.help] == []
    if command == "completion":
        return
    given = list(examples(sub.format_help()))
    assert given
    for words in given:
        assert words[0] == command
        see_that_it_is_taken(words)


@pytest.mark.parametrize(
    ("product", "given"),
    [
        ("fragility", ("--curves", "folder")),
        ("exclusion", ("--events", "folder")),
        ("displacement", ("--age", "2000")),
        ("rock", ("--table", "folder")),
        ("validation", ("--table", "folder", "--set", "yaw=0")),
    ],
)
def test_what_a_product_does_not_take_is_refused(
    product: str, given: tuple[str, ...], refused: Callable[..., str]
) -> None:
    refused("run", product, *given, words=(given[-2], f"{product} takes no", f"run {product} -"))


@pytest.mark.parametrize("question", ["plan", "status", "why"])
def test_tests_are_asked_about_by_their_folder(question: str, refused: Callable[..., str]) -> None:
    refused(question, "validation", words=("--table", "no folder of shake-table tests"))


@pytest.mark.parametrize("question", ["plan", "status", "why"])
def test_a_hazard_is_asked_about_by_its_options_or_their_keys(
    question: str, vsr: Callable[..., Ran], refused: Callable[..., str]
) -> None:
    asked = (question, "hazard", "--site", "cuboid_1x2x3", "--set", "motion.pga.num=4")
    refused(*asked, words=("--curves",))
    curves = str(ROOT / "data" / "raw" / "hazard" / "made_up")
    said = vsr(*asked, "--curves", curves, "--age", "2000")
    assert said.code == 0
    keys = (
        "--set",
        f"hazard.curves={curves}",
        "--set",
        "hazard.age={kind: normal, mean: 2000, sd: 0}",
    )
    assert said.out == vsr(*asked, *keys).out
    refused(question, "--age", "2000", words=("--age", "fragility takes no --age"))


def test_help_names_scans_that_can_be_fetched_and_the_schema_of_answers() -> None:
    assert [name for name in ORIGINALS if name not in COMMANDS["fetch"].format_help()] == []
    assert ANSWERS.is_file()
    for command in ("plan", "status", "why", "list"):
        assert ANSWERS.name in "".join(COMMANDS[command].format_help().split())


def test_help_of_all_names_the_documentation_and_that_of_completion_every_shell() -> None:
    assert "docs/index.md" in parser().format_help()
    said = COMMANDS["completion"].format_help()
    assert [shell for shell in ("bash", "zsh", "fish") if shell not in said] == []
    assert "source <(vsr completion bash)" in said
    assert said.index("autoload -U compinit && compinit") < said.index("(vsr completion zsh)")
