"""Schemas and option reference: current, and of one mind with what the program takes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from pipeline import ROOT
from pipeline.config.refusals import RENAMED

CONFIGS = ROOT / "configs"
SHIPPED = sorted(path.relative_to(CONFIGS).as_posix() for path in CONFIGS.rglob("*.yaml"))
LINE = "# yaml-language-server: $schema="


@cache
def read_schema(path: Path) -> dict[str, Any]:
    schema: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return schema


def takes(given: str) -> bool:
    schema = read_schema(CONFIGS / "schema.json")
    return jsonschema.Draft202012Validator(schema).is_valid(yaml.safe_load(given))


def test_pages_name_keys_as_they_are_today() -> None:
    named = re.compile(r"<code>(\w+)</code>")
    for page in (ROOT / "pipeline").rglob("*.html"):
        assert not RENAMED.keys() & set(named.findall(page.read_text(encoding="utf-8"))), page


@pytest.mark.slow
def test_generated_files_are_current() -> None:
    command = [sys.executable, "-m", "scripts.options"]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_file_names_its_schema_and_satisfies_it(name: str) -> None:
    path = CONFIGS / name
    text = path.read_text(encoding="utf-8")
    first = text.splitlines()[0]
    assert first.startswith(LINE)
    schema = read_schema(path.parent / first.removeprefix(LINE))
    jsonschema.Draft202012Validator(schema).validate(yaml.safe_load(text))


@pytest.mark.parametrize(
    "given",
    [
        "{}",
        "motion: {pga: {num: 3}}",
        "motion: {pga: 0.3}",
        "motion: {kind: record, files: one.csv}",
        "motion: {kind: ricker_pulse}",
        "motion: {kind: table, pulses: [{axis: z}]}",
        "simulation: {time_step: 0.001}",
        "simulation: {time_step: auto}",
        "pedestal: {cut: {kind: plane, point: [0, 0, 1], normal: [0, 0, 1]}}",
        "observed_boulder: null",
    ],
)
def test_schema_takes_a_layer(given: str) -> None:
    assert takes(given)


@pytest.mark.parametrize(
    "given",
    [
        "contact: {fricton: 0.4}",
        "contact: {friction: -1}",
        "contact: {friction: rough}",
        "motion: {pga: [9.81, 19.62]}",
        "motion: {pga: {strat: 1}}",
        "motion: {kind: table, pulses: [{pga_ratio: 1}]}",
        "yaw: [0, 700]",
        "simulation: {engine: havok}",
        "simulation: {time_step: 1}",
        "pedestal: {cut: {kind: sphere}}",
        "zebra: 1",
    ],
)
def test_schema_refuses(given: str) -> None:
    assert not takes(given)


def _numbers(schema: dict[str, Any]) -> list[tuple[str, str]]:
    """Keys that hold numbers, with their descriptions."""
    sections = [("", schema), *schema.get("$defs", {}).items()]
    return [
        (f"{section}.{key}", held["description"])
        for section, of in sections
        if section not in ("Range", "Spread")  # of the unit of their key
        for key, held in of["properties"].items()
        if '"type": "number"' in json.dumps(held) or '"type": "integer"' in json.dumps(held)
    ]


@pytest.mark.parametrize("name", ["schema.json", "tables/schema.json"])
def test_every_number_has_its_unit(name: str) -> None:
    numbers = _numbers(read_schema(CONFIGS / name))
    assert numbers
    without = [
        key
        for key, text in numbers
        if not (text.endswith("]") and " [" in text) and not text.startswith("number of ")
    ]
    assert without == []
