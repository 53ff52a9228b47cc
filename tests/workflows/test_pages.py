"""Every page in a browser: read on a wide screen, on a phone and in print, and the ways between."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import numpy as np
import pytest
from PIL import Image
from support.browser import PHONE, Opened, settle
from test_validation_product import write_tests

from pipeline import ROOT, cli
from pipeline.workflow import pages

pytestmark = pytest.mark.usefixtures("small_pictures")

CHECKS = (ROOT / "tests" / "support" / "page_checks.js").read_text(encoding="utf-8")
PAPER = {"width": 718, "height": 1000}
"""What is within the margins of a sheet of A4, in pixels of a browser."""

SITE = """\
rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}
motion: {pga: [0.1, 0.3, 0.5, 0.7], pgv_pga: [0.1, 0.2, 0.3, 0.4]}
yaw: [0, 90]
contact: {friction: [0.6]}
simulation: {time_step: 0.005}
"""
STUDY = "sweep: {friction: {contact.friction: [0.4, 0.6]}}\n"
CURVES = ROOT / "data" / "raw" / "hazard" / "made_up"
FAULTS = ROOT / "data" / "raw" / "hazard" / "made_up_faults.csv"
ARCHIVE = ROOT / "data" / "raw" / "archive" / "rocks.csv"
TERRAIN = ("motion.pga=[0.5,0.8]", "motion.pgv_pga=[0.3,0.4]", "simulation.time_step=0.004")

QUICK = {
    "rock/report.html": ("run", "fragility", "--site", "rock.yaml"),
    "rock/replays": (
        *("replay", "--site", "rock.yaml", "--pga", "0.5", "--pgv-pga", "0.3", "--yaw", "0"),
        *("--friction", "0.6", "--and", "neighbour"),
    ),
    "index.html": ("index",),
}
SLOW = {
    "rock/studies/small/study.html": (
        *("run", "fragility", "--site", "rock.yaml", "--study", "small.yaml"),
    ),
    "rock/uncertainty.html": ("run", "uncertainty", "--site", "rock.yaml"),
    "rock/hazard.html": (
        *("run", "hazard", "--site", "rock.yaml", "--curves", str(CURVES), "--age", "20000"),
    ),
    "rock/exclusion.html": (
        *("run", "exclusion", "--site", "rock.yaml", "--age", "20000"),
        *("--set", f"hazard.faults={FAULTS}"),
    ),
    "archives/rocks/archive.html": ("archive", str(ARCHIVE)),
    "block_tests/validation.html": ("run", "validation", "--table", "block_tests"),
    "rock/drive.html": ("run", "drive", "--site", "rock.yaml"),
    "double_rock_terrain/displacement.html": (
        *("run", "displacement", "--site", "double_rock_terrain"),
        *(word for setting in TERRAIN for word in ("--set", setting)),
    ),
    "double_rock_terrain/trajectories.html": ("index",),
    "double_rock_terrain/prep.html": ("prep", "--site", "double_rock_terrain"),
    "cuboid_1x1x2/accuracy.html": ("run", "accuracy", "--site", "cuboid_1x1x2"),
    "cuboid_1x1x2/stability.html": ("run", "stability", "--site", "cuboid_1x1x2"),
    "figures/claims.html": ("figures", "--fig", "8"),
}
"""Pages, each with the command that makes it after those before it."""

FEW = {
    "pipeline.stages.studies.accuracy.comparison.CELLS": 6,
    "pipeline.stages.studies.accuracy.comparison.STEPS": (1 / 500, 1 / 1000),
    "pipeline.stages.studies.accuracy.worker_tasks.BUDGET": 0.2,
    "vsr_core.verification.other_engines.names": lambda: ["mujoco_default", "published_setup"],
}
"""What makes the comparison of engines quick; its page stays the same."""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of results, and beside it what is asked of the program."""
    folder = tmp_path_factory.mktemp("pages")
    (folder / "rock.yaml").write_text(SITE, encoding="utf-8")
    (folder / "small.yaml").write_text(STUDY, encoding="utf-8")
    write_tests(folder / "block_tests")
    return folder / "derived"


def made(results: Path, page: str, command: tuple[str, ...]) -> Path:
    """The page that a command makes; of a folder, its one page."""
    path = results / page
    if not path.exists() or page == "index.html":
        words = [str(results.parent / w) if w.endswith(".yaml") else w for w in command]
        workers = () if command[0] in ("index", "prep", "archive") else ("--workers", "0")
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(results.parent)
            for name, value in FEW.items():
                patch.setattr(name, value)
            assert cli.main([*words, *workers, "--derived", str(results)]) == cli.DONE
    if path.is_dir():
        (path,) = path.glob("*.html")
    return path


def overflow(page: Any) -> list[str]:
    """What sticks out at the side of a page."""
    return page.evaluate(
        """() => document.documentElement.scrollWidth <= innerWidth ? [] :
        [...document.body.querySelectorAll("*")]
        .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
        .map((e) => `${e.tagName} ${e.className} ${e.textContent.slice(0, 40)}`).slice(0, 5)"""
    )


def silent(page: Any) -> list[str]:
    """What can be scrolled sideways on a page and does not look so."""
    return page.evaluate(
        """() => [...document.body.querySelectorAll("*")]
        .filter((e) => e.scrollWidth > e.clientWidth + 1)
        .filter((e) => /auto|scroll/.test(getComputedStyle(e).overflowX))
        .filter((e) => !getComputedStyle(e).backgroundImage.includes("gradient"))
        .map((e) => `${e.tagName} ${e.className} ${e.textContent.slice(0, 40)}`)"""
    )


def check(opened: Opened, path: Path, results: Path) -> None:
    """A page as its readers meet it."""
    wide = opened(path)
    settle(wide)
    assert wide.evaluate(CHECKS) == []
    assert overflow(wide) == []
    links = wide.evaluate("[...document.querySelectorAll('a[href]')].map((a) => a.href)")
    files = {Path(unquote(urlparse(link).path)) for link in links if link.startswith("file:")}
    assert [file for file in files if not file.is_file()] == []
    if path != results / "index.html":
        assert results / "index.html" in files
    narrow = opened(path, viewport=PHONE)
    settle(narrow)
    assert overflow(narrow) == []
    assert silent(narrow) == []
    for scheme in ("light", "dark"):
        narrow.emulate_media(color_scheme=scheme)
        assert narrow.evaluate(CHECKS) == []
    narrow.emulate_media(media="print")
    narrow.set_viewport_size(PAPER)
    settle(narrow)
    assert overflow(narrow) == []
    assert not narrow.locator(".back").is_visible()


@pytest.mark.parametrize("page", QUICK)
def test_a_page_can_be_read(opened: Opened, results: Path, page: str) -> None:
    check(opened, made(results, page, QUICK[page]), results)


@pytest.mark.slow
@pytest.mark.parametrize("page", SLOW)
def test_a_costly_page_can_be_read(opened: Opened, results: Path, page: str) -> None:
    check(opened, made(results, page, SLOW[page]), results)


def test_a_shadow_lies_on_the_side_that_hides_more(browser: Any) -> None:
    """A wide table and a wide picture, all white: what is dark at a side is the shadow."""
    white = "data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' width='900' height='90'>"
    white += "<rect width='900' height='90' fill='white'/></svg>"
    page = browser.new_page(viewport=PHONE)
    wide = "<table><tr><td style='min-width: 900px; height: 90px; border: 0'></td></tr></table>"
    for inside in (wide, f'<img style="width: 900px; max-width: none" src="{white}" alt="white">'):
        page.set_content(
            f"<style>{pages.source('page.css')}</style><div class='wide'>{inside}</div>"
        )
        box = page.locator(".wide")
        seen = []
        for at in (0, 250, 10_000):
            box.evaluate("(element, at) => element.scrollLeft = at", at)
            settle(page)
            grey = np.asarray(Image.open(io.BytesIO(box.screenshot())).convert("L"), dtype=float)
            row = grey[grey.shape[0] // 2]
            seen.append((row[1] < 200.0, row[len(row) // 2] < 250.0, row[-2] < 200.0))
        assert seen == [(False, False, True), (True, False, True), (True, False, False)]


def test_the_checks_see_what_is_wrong(browser: Any) -> None:
    page = browser.new_page()
    page.set_content(
        "<p style='color:#999'>pale</p><img src='data:image/png;base64,AAAA'><p>One.Two"
    )
    found = " ".join(page.evaluate(CHECKS))
    for fault in ("contrast 2.85", "not there", "without words", "no language", "no title",
                  "heading", "no viewport", "no blank: One.Two"):  # fmt: skip
        assert fault in found
    page.set_content("<pre style='width: 3000px'>wide</pre>")
    assert overflow(page) != []
    page.set_content("<div style='width: 9rem; overflow: auto'><pre>one line, wider than it</pre>")
    assert silent(page) != []
