"""The picture of stages, size and age of results, and completion in shells."""

from __future__ import annotations

import os
import re
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from conftest import Ran

from pipeline import cli
from pipeline.stages.hazard.other_rocks import folder_of
from pipeline.workflow.command_line import parser
from pipeline.workflow.owner import Ownership
from pipeline.workflow.registry import needs
from pipeline.workflow.store import Store
from pipeline.workflow.writers import text

SVG = "{http://www.w3.org/2000/svg}"
SHORT = "motion: {pga: [0.2, 0.6], pgv_pga: [0.2]}\nyaw: [0]\n"


def test_the_picture_has_every_stage_and_every_need(
    vsr: Callable[..., Ran], write_site: Callable[..., str], tmp_path: Path
) -> None:
    picture, site = tmp_path / "dag.svg", write_site(SHORT)
    assert vsr("plan", "--site", site, "--graph", picture).code == cli.DONE
    root = ElementTree.parse(picture).getroot()
    said, *stages = [str(text.text) for text in root.iter(f"{SVG}text")]
    assert said.startswith("rock: ")
    assert {"rock", "runs", "fragility", "report"} <= set(stages)
    boxes = {
        name: [float(box.attrib[key]) for key in ("x", "y", "width", "height")]
        for name, box in zip(stages, list(root.iter(f"{SVG}rect"))[1:], strict=True)
    }
    drawn: set[tuple[str, str]] = set()
    for line in root.iterfind(f"{SVG}path"):
        assert line.get("marker-end") == "url(#head)"
        places = [
            (float(x), float(y)) for x, y in re.findall(r"([\d.]+),([\d.]+)", line.attrib["d"])
        ]
        (need,), (name,) = (
            [of for of, (x, y, wide, _) in boxes.items() if (x + wide / 2, y + down * 34) == place]
            for place, down in ((places[0], 1), (places[-1], 0))
        )
        drawn.add((need, name))
        behind = [
            of
            for of, (x, y, wide, high) in boxes.items()
            for across, down in places[1:-1]
            if of not in (need, name) and x <= across <= x + wide and y <= down <= y + high
        ]
        assert behind == []
    whole = {(need, name) for name in stages for need in needs(name) if need in stages}
    needless = {(a, c) for a, b in whole for other, c in whole if other == b and (a, c) in whole}
    assert drawn == whole - needless  # no way of three steps alone makes one needless here
    gone = vsr("plan", "--site", site, "--graph", tmp_path / "nowhere" / "dag.svg")
    assert gone.code == cli.REFUSED
    assert len(gone.err.splitlines()) == 1


def test_what_is_old_is_removed_and_what_it_frees_is_told(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    for name in ("old", "new"):
        site = write_site(SHORT, name)
        assert vsr("run", "rock", "--site", site, "--workers", "0").code == cli.DONE
    month = time.time() - 31 * 86400
    for path in (derived / "old" / ".stages").iterdir():
        os.utime(path, (month, month))
    assert "last made 31 days ago" in vsr("status", "--site", derived.parent / "old.yaml").out
    held = sum(path.stat().st_size for path in (derived / "old").rglob("*") if path.is_file())
    ran = vsr("clean", "--older", "30d", "--yes")
    assert f"{held / 1e6:.1f} MB, last made 31 days ago" in ran.out
    assert not (derived / "old").exists()
    assert (derived / "new" / "rock.nc").exists()
    assert "nothing" in vsr("clean", "--older", "30d", "--yes").out
    wrong = vsr("clean", "--older", "a month")
    assert (wrong.code, len(wrong.err.splitlines())) == (cli.REFUSED, 1)


FACTS = {"key": "k", "facts": {"config": {}, "needs": {}}, "unresolved": 0, "retry": 0}


def put(folder: Path, stage: str, seconds: float = 0.0) -> None:
    """What a stage made some time ago."""
    with Store(folder) as store:
        store.open()
        store.publish(stage, FACTS, {f"{stage}.csv": text("x" * 50_000)})
    made = time.time() - seconds
    os.utime(folder / ".stages" / f"{stage}.json", (made, made))


def test_archives_are_cleaned_as_sites_are(vsr: Callable[..., Ran], derived: Path) -> None:
    put(derived / "archives" / "old", "archive", 31 * 86400)
    put(derived / "archives" / "new", "archive")
    put(derived / "rock", "rock")
    assert "archives/old: 0.1 MB" in vsr("clean", "--older", "30d", "--yes").out.replace(
        f"{derived}/", ""
    )
    assert [path.name for path in (derived / "archives").iterdir()] == ["new"]
    assert vsr("clean", "--yes", "--site", "archives/new").code == cli.DONE
    assert not list((derived / "archives").iterdir())
    assert (derived / "rock" / "rock.csv").exists()


def test_what_a_hazard_is_compared_with_goes_with_its_site(
    vsr: Callable[..., Ran], derived: Path, tmp_path: Path
) -> None:
    compared = derived / "rock" / folder_of("friction 0.4") / "rock"
    put(derived / "rock", "hazard")
    put(compared, "fragility")
    put(tmp_path / "other" / "rock", "rock")
    compared.parent.with_name("linked").symlink_to(tmp_path / "other")
    (compared / "runs.sqlite").write_bytes(b"x" * 50_000)
    owner = Ownership(compared)
    ran = vsr("clean", "--yes")  # while the comparison is made
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1)
    assert (derived / "rock" / "hazard.csv").is_file()
    owner.end()
    ran = vsr("clean", "--yes")
    assert ran.out.startswith(f"{derived / 'rock'}: 0.2 MB, last made less than a minute ago; left")
    assert ran.out.splitlines()[0].endswith(": compared/linked")
    left = [path.relative_to(derived).as_posix() for path in derived.rglob("*")]
    assert sorted(left) == ["rock", "rock/compared", "rock/compared/linked"]
    assert (tmp_path / "other" / "rock" / "rock.csv").is_file()


def test_no_lock_is_written_behind_a_link_to_all_comparisons(
    vsr: Callable[..., Ran], derived: Path, tmp_path: Path
) -> None:
    """A command at work there is in nobody's way, and nothing is made or removed."""
    put(derived / "rock", "hazard")
    put(tmp_path / "other" / "friction" / "rock", "rock")
    (derived / "rock" / "compared").symlink_to(tmp_path / "other")
    with Ownership(tmp_path / "other" / "friction" / "rock"):
        ran = vsr("clean", "--yes")
    assert (ran.code, ran.err) == (cli.DONE, "")
    assert ran.out.splitlines()[0].endswith("; left, as no results: compared")
    assert [path.name for path in (derived / "rock").iterdir()] == ["compared"]


def test_what_is_no_result_is_left_and_named_and_links_are_not_followed(
    vsr: Callable[..., Ran], derived: Path, tmp_path: Path
) -> None:
    put(derived / "rock", "rock")
    put(derived / "rock" / "studies" / "friction" / "friction=0.4", "rock")
    put(tmp_path / "other", "rock")
    ours = [derived / "rock" / "my_scan.ply", derived / "rock" / "mine" / "runs.sqlite"]
    ours += [derived / "rock" / "studies" / "notes.txt", derived / "rock" / "runs.sqlite.mine"]
    for path in (*ours, tmp_path / "other" / "precious.txt"):
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
    (derived / "link").symlink_to(tmp_path / "other")
    (derived / "rock" / "figures").symlink_to(tmp_path / "other")
    (derived / "rock" / ".part-1-rock.csv").touch()
    (derived / "rock" / "runs.sqlite.damaged-1-wal").touch()
    ran = vsr("clean", "--yes")
    left = ["figures", "my_scan.ply", "runs.sqlite.mine", "mine/runs.sqlite", "studies/notes.txt"]
    links, told = ran.out.replace(f"{derived}/", "").splitlines()
    assert links == "link: a link, which is left"
    assert told.startswith("rock: 0.1 MB, last made less than a minute ago; left, as no results: ")
    assert sorted(told.rpartition(": ")[2].split(", ")) == sorted(left)
    assert {path for path in (derived / "rock").rglob("*") if path.is_file()} == set(ours)
    assert sorted(path.name for path in (tmp_path / "other").iterdir()) == [
        ".stages",
        "precious.txt",
        "rock.csv",
    ]
    assert vsr("clean", "--yes").out.splitlines()[-1] == "nothing derived to remove"


def test_what_a_stage_no_longer_makes_goes(derived: Path) -> None:
    with Store(derived / "rock") as store:
        store.open()
        store.publish("report", FACTS, {"a.csv": text("a"), "b.csv": text("b")})
        store.publish("other", FACTS, {"b.csv": text("b")})
        store.publish("report", FACTS, {"c.csv": text("c")})
        assert sorted(path.name for path in store.folder.glob("*.csv")) == ["b.csv", "c.csv"]
        store.forget("report")
        assert store.names() == {"b.csv", "c.csv"}
        store.publish("report", FACTS, {"d.csv": text("d")})
        assert store.names() == {"b.csv", "d.csv"}
        assert sorted(path.name for path in store.folder.glob("*.csv")) == ["b.csv", "d.csv"]


def test_without_a_site_the_status_is_of_all_results(
    vsr: Callable[..., Ran], derived: Path
) -> None:
    assert vsr("status").out == f"no results in {derived}\n"
    ages = {"archives/rocks": 5.5 * 60, "boulder@rough": 3.5 * 3600, "rock": 49 * 3600, "slab": 20}
    for name, seconds in ages.items():
        put(derived / name, "rock", seconds)
    lines = vsr("status").out.splitlines()
    assert [line.split()[0] for line in lines] == list(ages)
    told = [line.partition(" MB, last made ")[2] for line in lines]
    assert told == ["5 minutes ago", "3 hours ago", "2 days ago", "less than a minute ago"]
    assert vsr("status", "--site", "").out.splitlines() == lines  # as make has it
    for words in (("fragility",), ("--study", "friction"), ("--set", "yaw=0")):
        assert "no site given" in vsr("status", *words).err


def test_a_status_names_its_product_and_the_others_that_are_there(
    vsr: Callable[..., Ran], derived: Path
) -> None:
    site = ("--site", "cuboid_1x1x2")
    for stage in ("rock", "displacement", "displacement_report", "hazard", "exclusion"):
        put(derived / "cuboid_1x1x2", stage)
    first, *rest = vsr("status", *site).out.splitlines()
    assert first == "status of fragility:"
    assert rest[-1] == "  also there: displacement, hazard"
    put(derived / "cuboid_1x1x2", "accuracy")
    first, *rest = vsr("status", "accuracy", *site).out.splitlines()
    assert first == "status of accuracy:"
    assert rest[-1] == "  also there: displacement, hazard"


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["vsr", "stat"], ["status"]),
        (["vsr", "run", "fragi"], ["fragility"]),
        (["vsr", "run", "rock", "--workers"], ["--workers"]),
        (["vsr", "plan", "--study", "friction_t"], ["friction_thresholds"]),
    ],
)
def test_bash_completes(words: list[str], wanted: list[str], vsr: Callable[..., Ran]) -> None:
    given = " ".join(words)
    asked = f"COMP_WORDS=({given}); COMP_CWORD={len(words) - 1}; _vsr; echo ${{COMPREPLY[@]}}"
    script = vsr("completion", "bash").out + asked
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == wanted


def test_other_shells_are_told_every_command(vsr: Callable[..., Ran]) -> None:
    verbs = set(parser()._subparsers._group_actions[0].choices)  # type: ignore[union-attr]
    for shell in ("zsh", "fish"):
        ran = vsr("completion", shell)
        assert [verb for verb in verbs if verb not in ran.out] == []
    assert vsr("completion", "tcsh").code == cli.REFUSED
