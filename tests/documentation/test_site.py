"""The documentation builds without a warning, and its notebooks run."""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path
from typing import Any

import matplotlib as mpl
import nbclient
import nbformat
import pytest

from pipeline import ROOT
from scripts import docs

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    assert docs.main(["--quick", "--build", str(tmp_path)]) == 0
    pages = sorted((tmp_path / "html").rglob("*.html"))
    assert len(pages) > 30
    front = (tmp_path / "html" / "index.html").read_text(encoding="utf-8")
    assert re.findall(r'<(?:script|link)[^>]*(?:src|href)="https?://', front) == []  # read offline


def test_notebooks_are_kept_without_what_they_print() -> None:
    assert len(NOTEBOOKS) == 5
    listed = (ROOT / "notebooks" / "index.md").read_text(encoding="utf-8")
    for path in NOTEBOOKS:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        code = [cell for cell in cells if cell["cell_type"] == "code"]
        assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code), path
        assert f"\n{path.stem}\n" in listed


def test_the_first_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process, where the engine is loaded already; Housner's block topples at 0.67 g."""
    path = ROOT / "notebooks" / "first_rock.ipynb"
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    with mpl.rc_context({"backend": "Agg"}):
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), path.name, "exec"), names)
    assert not list(tmp_path.iterdir())
    found = float(names["first"].sel(pgv_pga=0.25, method="nearest"))
    assert found == pytest.approx(0.67, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    book = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(book, timeout=600, resources=resources).execute()
    shown = [output for cell in book.cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in shown)


@pytest.mark.slow
def test_the_whole_site_builds(tmp_path: Path) -> None:
    assert docs.main(["--build", str(tmp_path)]) == 0
    html = tmp_path / "html"
    assert (html / "examples" / "double_rock" / "report.html").is_file()
    assert (html / "api" / "vsr_core.run.proofs.html").is_file()
    if any(map(shutil.which, docs.BROWSERS)):
        assert (html / "_images" / "page_index.png").stat().st_size > 20_000
