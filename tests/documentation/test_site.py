"""The documentation builds without a warning, and its notebooks run."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from pipeline import ROOT
from scripts import docs, links

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    assert docs.main(["--quick", "--build", str(tmp_path)]) == 0
    pages = sorted((tmp_path / "html").rglob("*.html"))
    assert len(pages) > 30
    front = (tmp_path / "html" / "index.html").read_text(encoding="utf-8")
    assert re.findall(r'<(?:script|link)[^>]*(?:src|href)="https?://', front) == []  # read offline


def test_links_of_the_checkout_lead_to_files() -> None:
    """As a visitor follows them who has built no site."""
    assert links.dead_in_checkout(ROOT) == []


def test_what_leads_nowhere_is_told(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "notebooks").mkdir()
    page = "[a](docs/there.md#part) ![b](docs/gone.png) [c](https://example.org)\n"
    (tmp_path / "README.md").write_text(page, encoding="utf-8")
    (tmp_path / "docs" / "there.md").write_text("```\n[d](no_link)\n```\n", encoding="utf-8")
    (tmp_path / "notebooks" / "one.ipynb").write_text('"[e](../docs/away.md)"', encoding="utf-8")
    assert links.dead_in_checkout(tmp_path) == [
        "README.md: docs/gone.png",
        "notebooks/one.ipynb: ../docs/away.md",
    ]
    (tmp_path / "index.html").write_text(
        "<a href='two.html#here'>1</a><a href='two.html#away'>2</a><a href='#top'>3</a>"
        "<img src='data:image/png;base64,AA'><img src='gone.png'><script src='a%20b.js'></script>"
        "<a href='data.nc'>4</a><a href='mailto:a@example.org'>5</a><h1 id='top'>6</h1>",
        encoding="utf-8",
    )
    (tmp_path / "two.html").write_text("<h2 id='here'>7</h2>", encoding="utf-8")
    (tmp_path / "a b.js").touch()
    assert links.dead_in_site(tmp_path) == [
        "index.html: two.html#away",
        "index.html: gone.png",
        "index.html: data.nc",
    ]


def test_notebooks_are_kept_without_what_they_print() -> None:
    assert len(NOTEBOOKS) == 7
    listed = (ROOT / "notebooks" / "index.md").read_text(encoding="utf-8")
    for path in NOTEBOOKS:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        code = [cell for cell in cells if cell["cell_type"] == "code"]
        assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code), path
        assert f"\n{path.stem}\n" in listed


def test_a_kernel_comes_with_what_the_page_of_notebooks_says_to_run() -> None:
    page = (ROOT / "notebooks" / "index.md").read_text(encoding="utf-8")
    assert "`make setup-dev`" in page
    assert importlib.util.find_spec("ipykernel")
    assert "\nipykernel==" in (ROOT / "requirements-dev.lock").read_text(encoding="utf-8")


def ran(name: str, cells: int | None = None) -> dict[str, Any]:
    """Names after the first code cells of a notebook, in this process: its engine is loaded."""
    path = ROOT / "notebooks" / name
    names: dict[str, Any] = {"__name__": "__main__"}
    found = json.loads(path.read_text(encoding="utf-8"))["cells"]
    with mpl.rc_context({"backend": "Agg"}):
        for cell in [cell for cell in found if cell["cell_type"] == "code"][:cells]:
            exec(compile("".join(cell["source"]), path.name, "exec"), names)
    return names


@pytest.mark.slow
def test_the_first_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Housner's block topples at 0.669 g."""
    monkeypatch.chdir(tmp_path)
    names = ran("first_rock.ipynb")
    assert [path.name for path in tmp_path.iterdir()] == ["results"]
    found = names["fragility"].first_overturning_pga.squeeze().interp(pgv_pga=0.25).item()
    assert found == pytest.approx(0.669, abs=0.01)


@pytest.mark.slow
def test_made_tests_with_known_answers_are_predicted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Housner's equation says which motions topple the block, from 4 % below its limit on."""
    monkeypatch.chdir(tmp_path)
    names = ran("recorded_test_and_hazard.ipynb", 2)
    predicted = names["predicted"].probability.values > 0.5
    np.testing.assert_array_equal(predicted, names["shares"] > 1.0)


def test_notebooks_take_the_public_way() -> None:
    """The parts of the program are imported nowhere, only `vsr`."""
    for path in NOTEBOOKS:
        text = path.read_text(encoding="utf-8")
        assert re.findall(r"(?:from|import) (vsr_core|pipeline)\b", text) == [], path.name


def test_what_notebooks_read_lies_beside_them_where_the_site_is_built(tmp_path: Path) -> None:
    docs.gather(tmp_path / "source")
    folder = tmp_path / "source" / "notebooks"
    texts = (path.read_text(encoding="utf-8") for path in folder.glob("*.ipynb"))
    named = {name for text in texts for name in re.findall(r'\\"(\.\./data/[^"\\]*)', text)}
    assert named
    assert [name for name in sorted(named) if not (folder / name).exists()] == []


@pytest.mark.slow
def test_the_whole_site_builds(tmp_path: Path) -> None:
    """Its notebooks are run, and each shows a picture."""
    assert docs.main(["--build", str(tmp_path)]) == 0
    html = tmp_path / "html"
    for notebook in NOTEBOOKS:
        page = (html / "notebooks" / f"{notebook.stem}.html").read_text(encoding="utf-8")
        assert '<div class="cell_output' in page
        assert re.search(r'<img alt="[^"]*" src="\.\./_images/[0-9a-f]{64}\.png"', page), notebook
    assert (html / "examples" / "double_rock" / "report.html").is_file()
    assert (html / "api" / "vsr_core.judge.proofs.html").is_file()
    assert links.dead_in_site(html) == []
    if any(map(shutil.which, docs.BROWSERS)):
        assert (html / "_images" / "page_index.png").stat().st_size > 20_000
