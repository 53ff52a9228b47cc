"""`vsr figures`: datasets from the sites' folders, the same bytes every time, and the page."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from pipeline import cli
from pipeline.drawing import style
from pipeline.stages.figures import fig_08, fig_12, fig_16, making, paper

GRID = ("--set", "motion.pga={start: 0.05, stop: 0.5, num: 10}",
        "--set", "motion.pgv_pga={start: 0.05, stop: 0.35, num: 3}")  # fmt: skip
FILES = [f"fig_08.{kind}" for kind in making.KINDS]


def figures(derived: Path, *given: str) -> int:
    return cli.main(["figures", "--workers", "0", "--derived", str(derived), *given])


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


pytestmark = pytest.mark.usefixtures("full_pictures")


@pytest.fixture(scope="module")
def derived(tmp_path_factory: pytest.TempPathFactory, quick_time_step: None) -> Path:
    """Fig. 8 on a small grid."""
    folder = tmp_path_factory.mktemp("paper") / "derived"
    assert figures(folder, "--fig", "8", *GRID) == 0
    return folder


def test_its_runs_are_those_of_the_sites(derived: Path) -> None:
    assert (derived / "w2_5.5cm" / "responses.nc").is_file()
    assert (derived / "w2_55cm" / "runs.sqlite").is_file()
    assert all((derived / "figures" / name).stat().st_size > 10_000 for name in FILES[:2])


def test_again_makes_nothing(derived: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {path: path.stat().st_mtime_ns for path in (derived / "figures").glob("*.*")}
    assert figures(derived, "--fig", "8", *GRID) == 0
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_the_same_bytes_every_time_and_no_date(derived: Path) -> None:
    data = {
        told: making.dataset(source, derived / source.folder)
        for told, source in fig_08.SOURCES.items()
    }
    for name, write in style.pictures("fig_08", fig_08.draw(data), making.KINDS).items():
        write(derived / name)
        made = (derived / "figures" / name).read_bytes()
        assert (derived / name).read_bytes() == made
        assert b"CreationDate" not in made
        assert b"dc:date" not in made


def test_the_figure_has_the_paper_s_axes_and_housner_s_curve(derived: Path) -> None:
    data = {
        told: making.dataset(source, derived / source.folder)
        for told, source in fig_08.SOURCES.items()
    }
    (axes,) = fig_08.draw(data).axes
    assert axes.get_xlim() == (0.05, 0.35)  # section 4.2
    assert axes.get_ylim() == (0.05, 0.5)
    assert axes.get_xlabel() == "PGV/PGA [s]"
    assert axes.get_ylabel().endswith("[g]")
    lines = {str(line.get_gid()): line for line in axes.get_lines()}
    # Housner's equation integrated apart from this project: at 0.20 and 0.35 s
    for block, expected in (("stated", (0.210, 0.205)), ("larger", (0.225, 0.215))):
        exact = lines[f"{block}-housner"]
        assert exact.get_ydata()[1:] == pytest.approx(expected, abs=0.006)
        first = np.asarray(lines[f"{block}-first"].get_ydata())
        assert first[1:] == pytest.approx(expected, abs=0.009)
    # above the grid's 0.5 g, as Housner's 0.555 g
    assert lines["larger-first"].get_ydata()[0] == pytest.approx(0.555, abs=0.006)


def test_the_verdicts_and_the_page(derived: Path) -> None:
    told = json.loads((derived / "figures" / "fig_08.json").read_text())["findings"]
    assert [one["found"] for one in told[:3]] == [None, False, True]  # 5.5 cm and 55 cm high
    page = (derived / "figures" / "claims.html").read_text()
    assert page.count('class="verdict not-testable-here"') == 3  # two are on speed
    assert "make figures FIG=12" in page  # of what is not made yet
    assert page.count("<img ") == 1
    assert f"Made with <code>{GRID[1]}" in page
    assert 'alt="Fig. 8' in page


@pytest.mark.slow
def test_results_of_another_site_of_that_name_stay(
    derived: Path, tmp_path: Path, write_site: Callable[..., str], vsr: Callable[..., Any]
) -> None:
    own = write_site(name="w2_55cm")
    assert vsr("run", "rock", "--site", own, into=tmp_path).code == 0
    mine = contents(tmp_path / "w2_55cm")
    assert figures(tmp_path, "--fig", "8", *GRID) == 0
    assert contents(tmp_path / "w2_55cm") == mine
    (shipped,) = tmp_path.glob("w2_55cm-*")
    name = "boundary.nc"
    assert (shipped / name).read_bytes() == (derived / "w2_55cm" / name).read_bytes()
    name = "figures/fig_08.json"
    assert (tmp_path / name).read_bytes() == (derived / name).read_bytes()


def test_a_figure_is_of_the_present_settings_that_it_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a boulder, which is in the key of no dataset that Fig. 16 draws."""

    def findings(data: paper.Data) -> list[paper.Finding]:
        place = data["displacement"].attrs["observed_boulder"]["position"]
        return [paper.Finding("", "", "", str(place), None)]

    lent = {"displacement": paper.Source("w2_55cm", "rock")}
    monkeypatch.setattr(fig_16, "SOURCES", lent)
    monkeypatch.setattr(fig_16, "draw", lambda _: Figure())
    monkeypatch.setattr(fig_16, "findings", findings)
    for place in ([1.0, 2.0], [1.0, 3.0]):
        given = ("--set", f"observed_boulder={{position: {place}, position_sd: 1}}")
        assert figures(tmp_path, "--fig", "16", *given) == 0
        told = json.loads((tmp_path / "figures" / "fig_16.json").read_text())["findings"]
        assert [one["measured"] for one in told] == [str(place)]


def test_figures_of_a_former_rock_are_not_on_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rock of Fig. 16 is another one when Fig. 12 is made, and then it is the former again."""
    for name, figure in (("Fig. 12", fig_12), ("Fig. 16", fig_16)):
        found = [paper.Finding("", f"A claim of {name}.", "", "", found=True)]
        monkeypatch.setattr(figure, "SOURCES", {"displacement": paper.Source("w2_55cm", "rock")})
        monkeypatch.setattr(figure, "draw", lambda _: Figure())
        monkeypatch.setattr(figure, "findings", lambda _, found=found: found)

    def reproduced(fig: str, *given: str) -> list[str]:
        """Figures that are on the page with a picture, of which each has one claim."""
        assert figures(tmp_path, "--fig", fig, *given) == 0
        page = (tmp_path / "figures" / "claims.html").read_text()
        there = re.findall(r"A claim of (Fig\. \d+)", page)
        assert f" {len(there)} w" in page  # were, or was, reproduced
        assert page.count("<img ") == len(there)
        return there

    assert reproduced("16", "--set", "rock.density=2000") == ["Fig. 16"]
    assert reproduced("12") == ["Fig. 12", "Fig. 16"]  # that tells with what it was made
    monkeypatch.setattr(fig_16, "SOURCES", {"displacement": paper.Source("w2_5.5cm", "rock")})
    assert reproduced("12") == ["Fig. 12"]
    monkeypatch.setattr(fig_16, "SOURCES", {"displacement": paper.Source("no_such", "rock")})
    assert reproduced("12") == ["Fig. 12"]
    monkeypatch.setattr(fig_16, "SOURCES", {"displacement": paper.Source("w2_55cm", "rock")})
    assert reproduced("12") == ["Fig. 12", "Fig. 16"]


def test_a_figure_that_there_is_not_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert figures(tmp_path / "none", "--fig", "99") == cli.REFUSED
    (line,) = capsys.readouterr().err.splitlines()
    assert "--fig" in line
    assert "'99'" in line
    assert "12" in line
    assert not (tmp_path / "none").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["13", "11"])
def test_settings_that_leave_out_what_a_figure_shows_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    given = (
        "yaw=[0]",
        "motion.pga=[0.2, 0.6]",
        "motion.pgv_pga=[0.2]",
        "simulation.time_step=0.002",
    )
    settings = [part for setting in given for part in ("--set", setting)]
    assert figures(tmp_path, "--fig", name, *settings) == cli.REFUSED
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("vsr: --set: got yaw=[0]")
    assert not list((tmp_path / "figures").glob(f"fig_{name}.*"))
