"""Every command of the documentation and of the help, run by bash as it is printed, in a clone."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import trimesh
import xarray as xr
from support.printed_commands import OPEN, PAGES, REFUSED, commands
from support.small_scan import survey, write_ply
from test_validation_product import write_tests

from pipeline import ROOT, cli
from pipeline.workflow import command_line

FILLED = {
    "<name>": "cuboid_1x1x2",
    "FIG=...": "FIG=8",
    "EVENTS=folder": "EVENTS=my_events",
    "STUDY=... SITE=... PRODUCT=displacement": "STUDY=my_study.yaml SITE=granite_dells "
    "PRODUCT=displacement",
    "--site SITE": "--site cuboid_1x1x2",
    "FOLDER_OR_ZIP FOLDER_OR_ZIP": "data/derived/double_rock data/derived/double_rock",
    " [--table mini_shake_robot]": "",
    " [--export DIR]": "",
    "tests/faults/FILE": "tests/faults/test_slurm.py",
    "ROCKS=rocks.csv": "ROCKS=data/raw/archive/rocks.csv",
}
"""What is put in for what a reader fills in; the files that pages name are in ``own_files``."""

STUDY = """\
motion: {pga: [0.5, 0.8], pgv_pga: [0.3, 0.4]}
sweep: {bounce: {contact.restitution: [0, 0.3]}}
"""

NOT_RUN = {
    r"(make|vsr) (fetch|lock|docs-links|release)|pip install": "asks the network",
    r"data/raw/double_rock_prints": "needs what was fetched",
    r"podman|apptainer": "is no program of the project",
    r"dask (scheduler|worker)|(SCHEDULER=|--scheduler )tcp://host|--cluster slurm|client_0": "asks "
    "other machines",
    r"join (theirs|FOLDER)": "has results of others",
    r"make (test|test-slow|check|coverage)\b|-m pytest": "is what runs this test",
    r"make (mutants|archive-equations|bench|figures$|accuracy( SITE=double_rock)?$)|run accuracy|"
    r"raw_scans|scripts\.(docs --pictures|mutants)": "takes an hour, or many "
    "minutes of what others do",
    r"make docs( |$)": "is what the tests of the site do",
    r"run geodata": "needs the extra gis",
    r"pre-commit install": "changes the repository's hooks",
    r"-m benchmarks\.": "takes hours and writes what docs/ says of them",
}
"""Commands that are not run, and why."""

_MADE = re.compile(r"-> (\S+)$", re.MULTILINE)


def printed() -> Iterator[str]:
    """Commands in the order of the pages, and those in the help, each once."""
    yield from (line.partition(" #")[0].strip() for page in PAGES for line in commands(page))
    parser = command_line.parser()
    verbs = parser._subparsers._group_actions[0].choices
    for one in (parser, *verbs.values()):
        lines = [line.strip() for line in one.format_help().splitlines()]
        yield from (line for line in lines if re.match(rf"vsr ({'|'.join(verbs)}) ", line))


def filled(line: str) -> str:
    """A command line with everything that a reader puts in."""
    for place, value in FILLED.items():
        line = line.replace(place, value)
    return line


def why_not(line: str) -> str:
    return next((why for pattern, why in NOT_RUN.items() if re.search(pattern, line)), "")


def named(line: str) -> bool:
    """Whether a line names a command and gives it nothing, as a text does that speaks of it."""
    return "--" not in line and not re.search(r"=\S", line)


RUN = [line for line in dict.fromkeys(map(filled, printed())) if not why_not(line)]


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh clone with an environment of its own, and the files of a reader's that pages name."""
    place = tmp_path_factory.mktemp("printed") / "vsr"
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(place)], check=True)
    environment(place)
    own_files(place)
    return place


def environment(place: Path) -> None:
    """The environment of this checkout in another, its files shared where the disk can."""

    def link(source: str, target: str) -> None:
        try:
            os.link(source, target)
        except OSError:
            shutil.copy2(source, target)

    shutil.copytree(ROOT / ".venv", place / ".venv", symlinks=True, copy_function=link)
    packages = next((place / ".venv").glob("lib/*/site-packages"))
    for file in (
        *(place / ".venv").iterdir(),
        *(place / ".venv" / "bin").iterdir(),
        *packages.glob("__editable__*"),
        *packages.glob("vsr-*/*"),
    ):
        if file.is_symlink() or not file.is_file():
            continue
        text = file.read_bytes()
        if str(ROOT).encode() in text:
            mode = file.stat().st_mode
            file.unlink()
            file.write_bytes(text.replace(str(ROOT).encode(), str(place).encode()))
            file.chmod(mode)


def own_files(place: Path) -> None:
    """A reader's rock, scan, records, curves and tests, with the YAML that pages print for them."""
    rock, site, placed = _yaml(place / "docs" / "how_to" / "own_scan.md")
    assert "pose:" in placed  # of files that no command of the page names
    (place / "my_rock.yaml").write_text(rock, encoding="utf-8")
    trimesh.creation.box([0.5, 0.7, 1.5]).export(place / "my_rock.ply")
    scan = place / "data" / "raw" / "my_site" / "scan.ply"
    scan.parent.mkdir()
    write_ply(scan, survey())
    (place / "configs" / "sites" / "my_site.yaml").write_text(site, encoding="utf-8")
    records, components = _yaml(place / "docs" / "how_to" / "own_record.md")
    assert "components:" in components  # of files that no command of the page names
    (place / "my_records.yaml").write_text(records, encoding="utf-8")
    (place / "my_study.yaml").write_text(STUDY, encoding="utf-8")
    shipped = place / "data" / "raw"
    (place / "quakes" / "more").mkdir(parents=True)
    shutil.copy(shipped / "records" / "soft.AT2", place / "quakes" / "RSN316.AT2")
    shutil.copy(shipped / "records" / "near.v2", place / "quakes" / "more")
    for folder in ("my_curves", "folder"):
        shutil.copytree(shipped / "hazard" / "made_up", place / folder)
    shutil.copytree(shipped / "hazard" / "made_up_events", place / "my_events")
    write_tests(place / "folder")


def _yaml(page: Path) -> list[str]:
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"^( *)```yaml\n(.*?)^ *```$", text, re.DOTALL | re.MULTILINE)
    return ["".join(row[len(indent) :] for row in body.splitlines(True)) for indent, body in blocks]


def opened(path: Path) -> None:
    """See that a product is whole."""
    if path.suffix == ".nc":
        xr.load_dataset(path).close()
    elif path.suffix == ".html":
        assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")
    else:
        assert any(path.iterdir()) if path.is_dir() else path.stat().st_size


@pytest.mark.slow
@pytest.mark.parametrize("line", RUN)
def test_a_command_does_what_its_page_says(line: str, clone: Path) -> None:
    path = os.pathsep.join([str(clone / ".venv" / "bin"), os.environ["PATH"]])
    surroundings = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    if line.startswith("vsr export data/derived/double_rock"):  # commands above changed settings
        line = f"rm -rf data/derived/double_rock && make fragility SITE=double_rock && {line}"
    if line.endswith("--export commands"):  # into a new folder, as another page has it, too
        shutil.rmtree(clone / "commands", ignore_errors=True)
    done = subprocess.run(
        ["bash", "-c", line],
        cwd=clone,
        env=surroundings | {"PATH": path},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    said = done.stdout + done.stderr
    assert "Traceback" not in said
    if f"$ {line}" in REFUSED or (named(line) and done.returncode):
        told = [row for row in said.splitlines() if row.startswith("vsr: ")]
        assert done.returncode == cli.REFUSED, said
        assert len(told) == 1, said
        return
    # make ends with 2 where the program ended with 1.
    unresolved = re.search(rf"^make.*: .* Error {cli.UNRESOLVED}$", said, re.MULTILINE)
    assert unresolved or done.returncode in (cli.DONE, cli.UNRESOLVED), said
    for product in _MADE.findall(said):
        opened(clone / product)
    if line == "make prep SITE=my_site":  # the page: accept the cut
        site = clone / "configs" / "sites" / "my_site.yaml"
        text = site.read_text(encoding="utf-8")
        site.write_text(text.replace("pedestal:\n", "pedestal:\n  cut: proposal\n"), "utf-8")


def test_nothing_is_left_for_a_reader_to_fill_in() -> None:
    assert [line for line in RUN if OPEN.search(line)] == []
    assert len(RUN) > 60


def test_the_files_of_a_reader_are_all_that_pages_name(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs" / "how_to", tmp_path / "docs" / "how_to")
    for name in ("records", "hazard"):
        shutil.copytree(ROOT / "data" / "raw" / name, tmp_path / "data" / "raw" / name)
    (tmp_path / "configs" / "sites").mkdir(parents=True)
    own_files(tmp_path)
    wanted = {name for line in RUN for name in re.findall(r"=(my_\w+(?:\.yaml)?|folder)\b", line)}
    assert len(wanted) > 4
    there = {*(path.name for path in tmp_path.iterdir()), "my_site"}
    assert wanted <= there


def test_each_reason_not_to_run_a_command_is_needed() -> None:
    lines = [filled(line) for line in printed()]
    for pattern in NOT_RUN:
        assert any(re.search(pattern, line) for line in lines), pattern
