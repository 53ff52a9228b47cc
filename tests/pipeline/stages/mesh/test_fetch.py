"""Fetching an original: whole, checked and scaled, or not there at all."""

from __future__ import annotations

import functools
import hashlib
import json
import os
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from pipeline import ROOT, cli
from pipeline.config.layers import Site, load_site
from pipeline.config.problems import InputError
from pipeline.stages.mesh import fetch, sources
from pipeline.stages.mesh.originals import ORIGINALS, Original
from pipeline.stages.studies.validation import recorded_tests
from pipeline.workflow.datasets import read

ORIGINAL = ROOT.parent / "shared" / "data" / "double_rock" / "double_rock_pbr_petg.dae"
SIZE, HEIGHT = np.array([0.3, 0.2, 0.5]), 1.5


class Handler(BaseHTTPRequestHandler):
    """Serves one body at /whole.dae; at /broken.dae it hangs up half-way."""

    def __init__(self, body: bytes, *arguments: Any) -> None:
        self.body = body
        super().__init__(*arguments)

    def do_GET(self) -> None:
        if self.path not in ("/whole.dae", "/broken.dae"):
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(self.body)))
        self.end_headers()
        half = len(self.body) // 2 if self.path == "/broken.dae" else len(self.body)
        self.wfile.write(self.body[:half])

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def serve() -> Iterator[Callable[[bytes], str]]:
    """Serve a body on this machine; returns the address of the server."""
    servers = []

    def start(body: bytes) -> str:
        handler = functools.partial(Handler, body)
        server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        servers.append(server)
        return f"http://127.0.0.1:{server.server_port}"

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


@pytest.fixture(autouse=True)
def no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setenv("no_proxy", "127.0.0.1")


@pytest.fixture
def published(monkeypatch: pytest.MonkeyPatch) -> bytes:
    """A model known as "model" whose vertices are split, as the real one's are."""
    mesh = trimesh.creation.box(extents=SIZE)
    mesh.unmerge_vertices()
    body = bytes(mesh.export(file_type="dae"))
    model = Original("http://192.0.2.1/model.dae", sha(body), HEIGHT, "someone (licence)")
    monkeypatch.setitem(ORIGINALS, "model", model)
    return body


def sha(body: bytes) -> str:
    return hashlib.sha256(body).hexdigest()


@pytest.fixture
def raw(tmp_path: Path) -> Path:
    return tmp_path / "raw"


def refusal(*words: str, name: str = "model", url: str | None, raw: Path) -> None:
    """One line with these words, and nothing on disk that was not there before."""
    before = {path: path.read_bytes() for path in raw.rglob("*") if path.is_file()}
    with pytest.raises(InputError) as caught:
        fetch.fetch(name, url, raw)
    assert len(caught.value.problems) == 1
    line = str(caught.value)
    assert "\n" not in line
    assert [word for word in words if word not in line] == [], line
    assert {path: path.read_bytes() for path in raw.rglob("*") if path.is_file()} == before
    assert before or not raw.exists()


def test_fetched_and_scaled(serve: Callable[[bytes], str], published: bytes, raw: Path) -> None:
    path = fetch.fetch("model", f"{serve(published)}/whole.dae", raw)
    assert path == raw / "model" / "model.ply"
    assert {p.name for p in path.parent.iterdir()} == {"model.ply", sources.ORIGIN}
    mesh = trimesh.load(path, process=False)
    scale = HEIGHT / SIZE[2]
    np.testing.assert_allclose(mesh.extents, SIZE * scale, rtol=1e-6)
    assert mesh.is_watertight
    assert len(mesh.vertices) == 8
    assert mesh.volume == pytest.approx(SIZE.prod() * scale**3, rel=1e-6)
    origin = json.loads((path.parent / sources.ORIGIN).read_text())
    assert origin["sha256"] == sha(path.read_bytes())
    assert origin["from"] == "someone (licence)"


def source_of(site: Site) -> sources.Source:
    found = sources.find(site.config.rock, site.config.pedestal, site)
    assert found is not None
    return found


def test_label_says_where_the_shape_is_from(
    serve: Callable[[bytes], str],
    published: bytes,
    raw: Path,
    tmp_path: Path,
    vsr: Callable[..., Any],
    derived: Path,
) -> None:
    path = fetch.fetch("model", f"{serve(published)}/whole.dae", raw)
    file = tmp_path / "site.yaml"
    file.write_text("rock: {shape: mesh, mesh: raw/model/, density: 2000, fallback: double_rock}\n")
    site = load_site(str(file))
    assert source_of(site).label == "public original, someone (licence)"
    assert vsr("run", "rock", "--site", file).code == 0
    rock = read(derived / "site" / "rock.nc")
    assert rock.attrs["shape_source"] == "public original, someone (licence)"
    # Edited or replaced by the user, it is their scan.
    mesh = trimesh.load(path, process=False)
    mesh.apply_scale(1.1)
    path.write_bytes(mesh.export(file_type="ply"))
    assert "public" not in source_of(site).label
    assert "scan" in source_of(site).label
    (path.parent / sources.ORIGIN).unlink()
    os.mkfifo(path.parent / sources.ORIGIN)  # would be waited for
    assert "scan" in source_of(site).label
    path.unlink()
    assert "surrogate" in source_of(site).label


def test_wrong_checksum(serve: Callable[[bytes], str], published: bytes, raw: Path) -> None:
    url = f"{serve(published + b' ')}/whole.dae"
    refusal(url, "SHA-256", sha(published + b" ")[:12], sha(published)[:12], url=url, raw=raw)


def test_broken_transfer(serve: Callable[[bytes], str], published: bytes, raw: Path) -> None:
    url = f"{serve(published)}/broken.dae"
    refusal(url, "no download", "IncompleteRead", url=url, raw=raw)


def test_no_such_page(serve: Callable[[bytes], str], published: bytes, raw: Path) -> None:
    url = f"{serve(published)}/other.dae"
    refusal(url, "no download", "404", "--url", url=url, raw=raw)


def test_no_server(published: bytes, raw: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{free.getsockname()[1]}/whole.dae"
    refusal(url, "no download", "check the network", "--url", url=url, raw=raw)


@pytest.mark.parametrize("url", ["not an address", "gopher://127.0.0.1/a", "http://"])
def test_address_that_is_none(published: bytes, raw: Path, url: str) -> None:
    refusal("no download", url=url, raw=raw)


def test_unknown_name(raw: Path) -> None:
    refusal("'rosetta'", "double_rock", name="rosetta", url=None, raw=raw)


@pytest.mark.parametrize("name", ["mine.ply", "mine.OBJ", "model.ply"])
def test_a_scan_that_is_there_stays(published: bytes, raw: Path, name: str) -> None:
    (raw / "model").mkdir(parents=True)
    (raw / "model" / name).write_text("mine")
    refusal(name, "one scan", "remove it", url="http://127.0.0.1:1/", raw=raw)


def test_body_that_is_no_mesh(
    serve: Callable[[bytes], str], raw: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Even with the right checksum nothing is kept of it."""
    body = b"<COLLADA/>"
    model = Original("http://192.0.2.1/model.dae", sha(body), HEIGHT, "someone")
    monkeypatch.setitem(ORIGINALS, "model", model)
    with pytest.raises(Exception):  # noqa: B017, PT011 (a fault of the program, not of the user)
        fetch.fetch("model", f"{serve(body)}/whole.dae", raw)
    assert not list(raw.rglob("*.ply"))


def test_folder_that_cannot_be_written(
    serve: Callable[[bytes], str], published: bytes, raw: Path
) -> None:
    raw.write_text("mine")
    with pytest.raises(InputError, match="cannot be written"):
        fetch.fetch("model", f"{serve(published)}/whole.dae", raw)
    assert raw.read_text() == "mine"


def test_failed_write_leaves_nothing(
    serve: Callable[[bytes], str], published: bytes, raw: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", full)
        with pytest.raises(InputError, match="No space left on device"):
            fetch.fetch("model", f"{serve(published)}/whole.dae", raw)
    assert not [p for p in raw.rglob("*") if p.suffix == ".ply" or p.name.startswith(".part")]
    fetch.fetch("model", f"{serve(published)}/whole.dae", raw)


def test_command_refuses_in_one_line(vsr: Callable[..., Any], published: bytes) -> None:
    ran = vsr("fetch", "rosetta")
    assert ran.code == cli.REFUSED
    assert len(ran.err.splitlines()) == 1
    ran = vsr("fetch", "model", "--url", "http://127.0.0.1:1/model.dae")
    assert ran.code == cli.REFUSED
    assert len(ran.err.splitlines()) == 1
    assert not (ROOT / "data" / "raw" / "model").exists()


def test_published_address_is_pinned() -> None:
    """The file that shared/data/README.md names: its commit, path and checksum."""
    entry = ORIGINALS["double_rock"]
    commit = "69e7023511f34f442df357ea7d762316fa648633"
    assert entry.url.startswith("https://")
    assert f"/DREAMS-lab/pbr_gazebo/{commit}/" in entry.url
    assert entry.sha256 == "6ca837688891261ca5d4014cd167abe4b5ec38d5207abaf87240d7d414b6e30b"
    assert entry.height == 1.5085


def test_the_boulder_is_pinned_and_kept_as_large_as_it_is(
    serve: Callable[[bytes], str], raw: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its commit and licence; its file is in metres."""
    body = trimesh.creation.box(SIZE).export(file_type="obj").encode()
    entry = ORIGINALS["granite_boulder"]
    commit = "351dd2eaff00f39d75cdc24200020a82525c5d2b"
    assert entry.url.endswith(f"/ZhiangChen/VSR_Pro/{commit}/data/granite.obj")
    assert len(entry.sha256) == 64
    assert "Apache-2.0" in entry.credit
    assert entry.height is None
    monkeypatch.setitem(ORIGINALS, "granite_boulder", replace(entry, sha256=sha(body)))
    path = fetch.fetch("granite_boulder", f"{serve(body)}/whole.dae", raw)
    np.testing.assert_allclose(trimesh.load(path, process=False).extents, SIZE, rtol=1e-6)


@pytest.mark.parametrize("linked", [False, True])
def test_the_note_of_another_scan_does_not_stay_beside_an_original(
    linked: bool, serve: Callable[[bytes], str], raw: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scan it is of was removed, or has a folder of its own, where the note stays."""
    body = trimesh.creation.box(SIZE).export(file_type="obj").encode()
    name, mine = "granite_boulder", '{"from": "my own scan"}'
    monkeypatch.setitem(ORIGINALS, name, replace(ORIGINALS[name], sha256=sha(body)))
    (raw / name).mkdir(parents=True)
    note = raw / name / sources.ORIGIN
    if linked:
        (raw / "mine.json").write_text(mine)
        note.symlink_to(raw / "mine.json")
    else:
        note.write_text(mine)
    path = fetch.fetch(name, f"{serve(body)}/whole.dae", raw)
    assert sources.origin_of(path)["from"] == ORIGINALS[name].credit
    assert sources.origin_of(path)["sha256"] == sha(path.read_bytes())
    assert not linked or (raw / "mine.json").read_text() == mine


@pytest.mark.parametrize("full", [False, True])
def test_assumptions_and_outcomes_of_ones_own_stay(
    full: bool,
    serve: Callable[[bytes], str],
    raw: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The specimen was removed, as one is told to, to fetch the original again."""
    body = bytes(trimesh.creation.box(extents=SIZE).export(file_type="dae"))
    name = "double_rock_prints"
    monkeypatch.setitem(ORIGINALS, name, replace(ORIGINALS[name], sha256=sha(body)))
    own = {"table.yaml": "members: 40\n", "outcomes.csv": "test\n1\n"}
    (raw / name).mkdir(parents=True)
    for file, text in own.items():
        (raw / name / file).write_text(text)
    url = f"{serve(body)}/whole.dae"
    if full:  # a torn file would be taken for one's own from then on

        def torn(path: Path, _: bytes) -> int:
            path.touch()
            raise OSError(28, "No space left on device")

        with monkeypatch.context() as patch:
            patch.setattr(Path, "write_bytes", torn)
            with pytest.raises(InputError, match="No space left on device"):
                fetch.fetch(name, url, raw)
        assert {path.name for path in (raw / name).iterdir()} == own.keys()
    assert fetch.fetch(name, url, raw).is_file()
    assert {file: (raw / name / file).read_text() for file in own} == own
    assert (raw / name / "schema.json").stat().st_size > 0
    told = capsys.readouterr().err
    others = "outcomes.csv and table.yaml other than what comes with double_rock_prints by now"
    assert f"{others}, left as found" in told


@pytest.mark.skipif(not ORIGINAL.is_file(), reason=f"reference data absent: {ORIGINAL.name}")
def test_double_rock(serve: Callable[[bytes], str], raw: Path) -> None:
    path = fetch.fetch("double_rock", f"{serve(ORIGINAL.read_bytes())}/whole.dae", raw)
    mesh = trimesh.load(path, process=False)
    assert mesh.is_watertight
    assert mesh.extents[2] == pytest.approx(1.5085, rel=1e-6)
    assert mesh.volume == pytest.approx(0.5529, rel=0.001)
    np.testing.assert_allclose(mesh.extents, [1.238, 0.754, 1.5085], rtol=0.001)
    assert mesh.body_count == 1


def test_a_specimen_comes_with_its_tests(
    serve: Callable[[bytes], str], raw: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its folder is one that a validation reads: 83 outcomes, and 134 tests to predict."""
    mesh = trimesh.creation.box(extents=SIZE)
    body = bytes(mesh.export(file_type="dae"))
    name = "double_rock_prints"
    monkeypatch.setitem(ORIGINALS, name, replace(ORIGINALS[name], sha256=sha(body)))
    path = fetch.fetch(name, f"{serve(body)}/whole.dae", raw)
    assert path == raw / name / "sp1.ply"
    np.testing.assert_allclose(trimesh.load(path).extents, SIZE * 0.120 / SIZE[2], rtol=1e-6)
    tests = recorded_tests.tests_in(raw / name)
    outcomes, series = np.array(tests.observed[1]), np.array(tests.series)
    assert (outcomes[series == "yaw 0"] >= 0).sum() == (series == "yaw 0").sum() == 83
    assert (outcomes[series == "yaw 270"] == -1).sum() == (series == "yaw 270").sum() == 134
    assert tests.number[82:84] == (83, 1001)
    assert set(np.array(tests.azimuth)[series == "yaw 270"]) == {90.0}
    assert tests.config.stepper is not None
