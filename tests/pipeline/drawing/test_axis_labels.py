"""What the axes of figures say: each measure of shaking in its one unit, that of the catalogue."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from pipeline import ROOT
from pipeline.workflow.datasets import catalogue

SHOWN = {"PGA": catalogue()["pga"]["units"], "PGV/PGA": catalogue()["pgv_pga"]["units"]}
"""Grids are of these two; no figure has an axis of another measure."""

MEASURE = re.compile(r"\b(PGV/PGA|PG[AVD]|SA)\b[^\[\]]* \[([^\]]+)\]$")


def test_measures_of_shaking_have_their_unit() -> None:
    found = []
    for path in (ROOT / "pipeline" / "stages").rglob("*.py"):
        found += [(path, *measure) for text in _texts(path) for measure in MEASURE.findall(text)]
    assert len(found) > 10
    assert [one for one in found if SHOWN.get(one[1]) != one[2]] == []


def _texts(path: Path) -> list[str]:
    """Texts in a module, without those that are statements: docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    nodes = (node for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return [node.value for node in nodes if isinstance(node.value, str) and id(node) not in said]
