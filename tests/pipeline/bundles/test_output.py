"""The file that --to or --graph names: nothing of the user's is lost to it, and nothing torn."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import BOX, STEP, Ran

from pipeline import cli

Bytes = dict[Path, bytes]


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory, quick_time_step: None) -> Path:
    """A site, the folder of its rock, and a bundle of it."""
    folder = tmp_path_factory.mktemp("once")
    (folder / "box.yaml").write_text(f"{BOX}{STEP}")
    words = ["run", "rock", "--site", str(folder / "box.yaml"), "--workers", "0"]
    assert cli.main([*words, "--derived", str(folder / "derived")]) == cli.DONE
    shutil.move(folder / "derived" / "box", folder / "F")
    assert cli.main(["export", str(folder / "F"), "--to", str(folder / "B.zip")]) == cli.DONE
    shutil.copy(folder / "B.zip", folder / "B.html")
    (folder / "link.html").symlink_to("F/page.html")
    return folder


@pytest.fixture
def here(once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder: a copy of these."""
    shutil.copytree(once, tmp_path, symlinks=True, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def held(folder: Path) -> Bytes:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "words",
    [
        "compare F B.zip --to B.zip",
        "compare F B.html --to B.html",
        "compare F F --to F/rock.nc",
        "compare F F --to F/page.html",
        "compare F F --to F/.stages/page.html",
        "compare F F --to link.html",
        "compare F F --to box.yaml",
        "export F --to F/rock.nc",
        "export F --to F/new.zip",
        "export F --to box.yaml",
        "export F --to nowhere/new.zip",
        "plan rock --site box.yaml --graph box.yaml",
        "plan rock --site box.yaml --graph F/new.svg",
    ],
)
def test_no_product_and_no_input_is_written_over(
    words: str, here: Path, vsr: Callable[..., Ran]
) -> None:
    before = held(here)
    ran = vsr(*words.split())
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran
    option, path = words.split()[-2:]
    assert ran.err.startswith(f"vsr: {option}: got {path}, ")
    assert held(here) == before


def test_an_empty_name_is_refused(here: Path, vsr: Callable[..., Ran]) -> None:
    for words in ("export F", "compare F F", "plan rock --site box.yaml"):
        option = "--graph" if words.startswith("plan") else "--to"
        ran = vsr(*words.split(), option, "")
        assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran


@pytest.mark.parametrize(
    "words",
    [
        "export F --to {}.zip",
        "compare F F --to {}.html",
        "plan rock --site box.yaml --graph {}.svg",
    ],
)
def test_a_long_name_is_written_and_one_too_long_is_refused(
    words: str, here: Path, vsr: Callable[..., Ran]
) -> None:
    assert vsr(*words.format("n" * 250).split()).code == cli.DONE
    ran = vsr(*words.format("n" * 260).split())
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran


def test_what_cannot_be_written_leaves_what_was_there_and_names_the_option(
    here: Path, vsr: Callable[..., Ran], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("old.html").write_text("old")
    before = held(here)

    def full(path: Path, content: bytes) -> None:
        path.open("wb").write(content[:10])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    ran = vsr("compare", "F", "F", "--to", "old.html")
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran
    assert ran.err.startswith("vsr: --to: got old.html, ")
    assert "DERIVED" not in ran.err
    assert held(here) == before
