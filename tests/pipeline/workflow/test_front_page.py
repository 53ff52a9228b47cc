"""The index of all results: what it finds, what it says, and when it is written."""

from __future__ import annotations

import base64
import errno
import io
import os
import re
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote

import netCDF4
import numpy as np
import pytest
import xarray as xr
from conftest import Ran
from PIL import Image

from pipeline.config.problems import InputError
from pipeline.workflow import front_page, front_page_text, pages, writers
from pipeline.workflow.datasets import netcdf
from pipeline.workflow.store import Store, manifest_text
from tests.support.bad_input import bounded

HOSTILE = "<script>alert(1)</script>"


def page(title: str, answer: str = "", picture: str = "") -> str:
    image = f'<img alt="a" src="data:image/png;base64,{picture}">' if picture else ""
    return f'<html><title>{title}</title><p class="answer">{answer}</p>{image}</html>'


def picture(width: int, height: int) -> str:
    drawn = io.BytesIO()
    Image.new("RGB", (width, height), "navy").save(drawn, "png")
    return base64.b64encode(drawn.getvalue()).decode()


def publish(store: Store, stage: str, texts: dict[str, str], unresolved: int = 0) -> None:
    facts = {"key": "k", "facts": {}, "unresolved": unresolved, "retry": 0}
    with store:
        store.open()
        store.publish(stage, facts, {name: writers.text(text) for name, text in texts.items()})


@pytest.fixture
def results(derived: Path) -> Path:
    """A site with a page and a dataset, and a member of a study of it."""
    site = Store(derived / "a rock")
    answer = "It topples at <strong>0.3&nbsp;g</strong> &amp; more"
    publish(site, "report", {"report.html": page("A rock's report", answer, picture(900, 300))})
    publish(site, "replay", {"replays/one.html": page("&lt;script&gt;alert(1)&lt;/script&gt;")}, 3)
    publish(Store(site.folder / "studies" / "size" / "1 m", site), "rock", {"rock.csv": "a"})
    errors = xr.Dataset({"boundary_error": ("friction", [0.0012, np.nan])})
    facts = {"key": "k", "facts": {}, "unresolved": 0, "retry": 0}
    with site:
        site.open()
        site.publish("responses", facts, {"responses.nc": netcdf(errors)})
    return derived


def index(results: Path) -> str:
    found = front_page.renew(results)
    assert found == results / "index.html"
    return found.read_text(encoding="utf-8")


def test_each_product_is_listed_with_what_its_page_says(results: Path) -> None:
    text = index(results)
    assert "A rock&#39;s report" in text
    assert "It topples at 0.3 g &amp; more" in text
    assert "3 runs unresolved" in text
    assert "Numerical error of the boundary: 0.12 %, not measured at 1 of 2." in text
    assert HOSTILE not in text
    shown = re.search(r'src="data:image/png;base64,([^"]+)"', text)
    assert shown
    assert Image.open(io.BytesIO(base64.b64decode(shown[1]))).size == (320, 107)


def test_a_dataset_that_lacks_what_is_asked_for_is_listed_all_the_same(results: Path) -> None:
    facts = {"key": "k", "facts": {}, "unresolved": 0, "retry": 0}
    with Store(results / "older") as store:
        store.open()
        store.publish("rock", facts, {"rock.nc": netcdf(xr.Dataset())})
        store.publish("responses", facts, {"responses.nc": netcdf(xr.Dataset())})
    text = index(results)
    assert "older/rock.nc" in text
    assert "older/responses.nc" in text.partition("Runs without a page of their own")[2]
    assert str(results) not in (results / ".index.json").read_text(encoding="utf-8")


def test_every_link_leads_to_a_product(results: Path) -> None:
    links = set(re.findall(r'href="([^"#]+)"', index(results)))
    assert len(links) == 4
    assert [link for link in links if not (results / unquote(link)).is_file()] == []


def test_it_is_written_when_something_changed_and_only_then(results: Path) -> None:
    index(results)
    path = results / "index.html"
    first = path.stat().st_ino
    index(results)
    assert path.stat().st_ino == first
    publish(Store(results / "another"), "report", {"report.html": page("Another")})
    assert "Another" in index(results)
    (results / ".index.json").write_text("damaged", encoding="utf-8")
    assert "Another" in index(results)


def test_it_shows_what_is_there(results: Path) -> None:
    """Not what was: a page, a replay and a dataset that are gone, or another in its place."""
    for site in ("lost", "replaced"):
        texts = {"report.html": page(f"Of {site}"), "replays/one.html": page(f"Run of {site}")}
        publish(Store(results / site), "report", texts | {"fragility.csv": "a"})
    assert "Run of lost" in index(results)
    for name in ("report.html", "replays/one.html", "fragility.csv"):
        (results / "lost" / name).unlink()
        text = index(results)
        assert f"lost/{name}" not in text
        assert f"replaced/{name}" in text
    (results / "replaced" / "report.html").write_text("junk")
    text = index(results)
    assert "Of replaced" not in text
    assert "Run of replaced" in text


def test_without_products_there_is_none(results: Path) -> None:
    index(results)
    for folder in list(front_page.product_folders(results)):
        (folder / ".stages").rename(folder / "gone")
    assert front_page.renew(results) is None
    assert not (results / "index.html").exists()


OWN = "<title>Results</title> of my own"


@pytest.mark.parametrize(("command", "code"), [(("index",), 2), (("clean", "--yes"), 0)])
def test_without_products_a_page_of_the_users_own_is_left(
    vsr: Callable[..., Ran], derived: Path, command: tuple[str, ...], code: int
) -> None:
    derived.mkdir()
    (derived / "index.html").write_text(OWN, encoding="utf-8")
    assert vsr(*command).code == code
    assert (derived / "index.html").read_text(encoding="utf-8") == OWN


@pytest.mark.parametrize("damage", [lambda text: "", lambda text: text.replace("0.3", "0.1")])
def test_a_damaged_index_is_written_anew(results: Path, damage: Callable[[str], str]) -> None:
    whole = index(results)
    (results / "index.html").write_text(damage(whole), encoding="utf-8")
    assert index(results) == whole


@pytest.mark.parametrize("replaced", [False, True])
def test_a_page_of_the_users_own_is_left_and_named(results: Path, replaced: bool) -> None:
    path = results / "index.html"
    if replaced:
        index(results)
    path.write_text(OWN, encoding="utf-8")
    for _ in range(2):
        with pytest.raises(InputError, match=r"index\.html: got a page of another kind"):
            front_page.renew(results)
        assert path.read_text(encoding="utf-8") == OWN
    path.unlink()
    before = index(results)
    (results / ".index.json").unlink()
    assert index(results) == before


def test_who_asks_for_none_is_told_so(refused: Callable[..., str]) -> None:
    refused("index", words=("no index of results", "make fragility"))


def test_what_is_no_page_is_left_and_named(results: Path) -> None:
    path = results / "index.html"
    path.mkdir()
    with pytest.raises(InputError, match=r"index\.html: got no regular file"):
        front_page.renew(results)
    path.rmdir()
    with path.open("wb") as file:
        file.truncate(2 * 1024**3)
    with bounded(5.0, 500.0), pytest.raises(InputError, match=r"index\.html: got a file of 2 GiB"):
        front_page.renew(results)
    assert path.stat().st_size == 2 * 1024**3


def test_a_folder_that_cannot_be_written_to_is_no_failure(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_room(*_: object) -> None:
        raise OSError(errno.ENOSPC, "no space left")

    monkeypatch.setattr(os, "fsync", no_room)
    assert front_page.renew(results) is None
    assert not list(results.glob(".part-*"))


def test_without_what_was_read_for_it_it_is_written_all_the_same(results: Path) -> None:
    (results / ".index.json").mkdir()
    for _ in range(2):
        assert "A rock&#39;s report" in index(results)


@pytest.mark.parametrize("below", ["", "studies/size/1 m"])
def test_the_way_back_leads_to_the_index(derived: Path, below: str) -> None:
    site = Store(derived / "rock")
    store = Store(site.folder / below, site) if below else site
    assert (store.folder / store.up / "index.html").resolve() == (derived / "index.html").resolve()
    assert 'href="../index.html"' in pages.filled("back.html", {})


GOOD = {"key": "k", "facts": {}, "unresolved": 0, "retry": 0, "files": {"report.html": "x"}}
MANIFESTS = {
    "a number as text": manifest_text(GOOD | {"unresolved": "x"}),
    "no number": manifest_text(GOOD | {"unresolved": None}),
    "less than none": manifest_text(GOOD | {"unresolved": -5}),
    "beyond numbers": manifest_text(GOOD).replace(": 0", ": 1e400"),
    "a list": "[1]",
    "files in a list": manifest_text(GOOD | {"files": ["a"]}),
    "no checksum": manifest_text(GOOD | {"files": {"report.html": ["x"]}}),
    "deep": "[" * 100_000,
    "half a character": manifest_text(GOOD | {"stale": "\ud800"}),
    "no text": b"\xff\xfe",
    "a file elsewhere": manifest_text(GOOD | {"files": {"/etc/passwd.html": "x"}}),
    "a file above": manifest_text(GOOD | {"files": {"../../secret.html": "x"}}),
}


def beside(results: Path, **files: str | bytes) -> Path:
    """A folder of products beside the others, with a manifest and files."""
    folder = results / "broken"
    (folder / ".stages").mkdir(parents=True)
    for file, content in ({".stages/report.json": manifest_text(GOOD)} | files).items():
        content = content.encode() if isinstance(content, str) else content
        (folder / file).write_bytes(content)
    return folder


def index_of_rest(results: Path, capsys: pytest.CaptureFixture[str], named: str) -> str:
    """The index, which names what is left out, and lists the rest."""
    with bounded(seconds=2.0, mebibytes=100.0):
        text = index(results)
    assert "A rock&#39;s report" in text
    assert f"<code>{named}</code>" in text
    told = f"vsr: warning: index: {named} cannot be read and is left out\n"
    assert capsys.readouterr().err == told
    return text


@pytest.mark.parametrize("case", MANIFESTS)
def test_a_broken_manifest_is_left_out_and_named(
    results: Path, capsys: pytest.CaptureFixture[str], case: str
) -> None:
    beside(results, **{".stages/report.json": MANIFESTS[case]})
    index_of_rest(results, capsys, "broken/.stages/report.json")


@pytest.mark.parametrize("kind", ["pipe", "folder", "device"])
def test_a_page_that_is_no_file_is_left_out_and_named(
    results: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    path = beside(results) / "report.html"
    {
        "pipe": lambda: os.mkfifo(path),
        "folder": path.mkdir,
        "device": lambda: path.symlink_to("/dev/zero"),
    }[kind]()
    index_of_rest(results, capsys, "broken/report.html")


def text_errors(data: netCDF4.Dataset) -> None:
    data.createDimension("a", 1)
    data.createVariable("boundary_error", str, ("a",))[0] = "q"


def no_errors(data: netCDF4.Dataset) -> None:
    data.createDimension("a", 1)


def many_errors(data: netCDF4.Dataset) -> None:
    data.createDimension("a", 10**10)
    data.createVariable("boundary_error", "f8", ("a",), zlib=True, chunksizes=(10**6,))


@pytest.mark.parametrize("change", [no_errors, text_errors, many_errors])
def test_a_dataset_that_is_none_is_left_out_and_named(
    results: Path, capsys: pytest.CaptureFixture[str], change: Callable[[netCDF4.Dataset], None]
) -> None:
    manifest = manifest_text(GOOD | {"files": {"responses.nc": "x"}})
    folder = beside(results, **{".stages/report.json": manifest})
    with netCDF4.Dataset(folder / "responses.nc", "w") as data:
        change(data)
    index_of_rest(results, capsys, "broken/responses.nc")


def test_a_folder_whose_name_is_no_text_is_left_out_and_named(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    beside(results).rename(os.fsdecode(os.fsencode(results) + b"/\xff\xfe"))
    text = index_of_rest(results, capsys, "\\udcff\\udcfe")
    assert text.encode()


def png(width: int, height: int, more: bytes = b"") -> str:
    """A picture that says it is larger than what it holds."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        check = struct.pack(">I", zlib.crc32(kind + content))
        return struct.pack(">I", len(content)) + kind + content + check

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0))
    content = b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(bytes(1000))) + more
    return base64.b64encode(content).decode()


def gif() -> str:
    """A picture of another kind than its page says; to read some kinds a program is started."""
    content = io.BytesIO()
    Image.new("RGB", (9, 9)).save(content, "gif")
    return base64.b64encode(content.getvalue()).decode()


@pytest.mark.parametrize(
    "content",
    [png(30_000, 30_000), png(13_000, 13_000), png(9, 9, b"\0\0\0\5IDATxx"), gif(), "!!!"],
)
def test_a_page_whose_picture_is_none_is_left_out_and_named(
    results: Path, capsys: pytest.CaptureFixture[str], content: str
) -> None:
    beside(results, **{"report.html": page("Without a picture", "", content)})
    assert "Without a picture" not in index_of_rest(results, capsys, "broken/report.html")


def test_what_the_last_index_is_said_to_have_read_is_read_anew_where_it_is_changed(
    results: Path,
) -> None:
    index(results)
    known = results / ".index.json"
    known.write_text(known.read_text().replace("0.3", "0.1").replace('"stamp":"', '"stamp":"x'))
    assert "topples at 0.3" in index(results)


def test_a_broken_index_decides_no_other_command(
    vsr: Callable[..., Ran], derived: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside(derived, **{".stages/report.json": MANIFESTS["a list"]})
    given = ("run", "rock", "--site", "cuboid_1x1x2", "--workers", "0")
    ran = vsr(*given)
    assert ran.code == 0
    assert "index: broken/.stages/report.json cannot be read" in ran.err
    monkeypatch.setattr(front_page, "product_folders", lambda derived: 1 / 0)
    ran = vsr(*given)
    assert ran.code == 0
    assert "index: not renewed (division by zero)" in ran.err


HOSTILE_PAGES = ("<title>", '<p class="answer">', "<img ", page("A", "<" * 400_000))


@pytest.mark.parametrize("piece", HOSTILE_PAGES, ids=range(len(HOSTILE_PAGES)))
def test_a_page_is_read_in_a_time_like_its_length(piece: str, tmp_path: Path) -> None:
    """What looks from each tag to the end of a page of 400 kB takes from half a minute to four."""
    path = tmp_path / "report.html"
    path.write_text(piece * (400_000 // len(piece) or 1))
    with bounded(seconds=4.0, mebibytes=100.0):
        found = front_page_text._page(path)
    assert found["title"] in ("A", "report")
