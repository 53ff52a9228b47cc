"""Results as one file: made again elsewhere with the same bytes, checked, and never trusted."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import stat
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from conftest import Ran
from support.suites import slow_but

from pipeline import cli
from pipeline.bundles import layout
from pipeline.workflow.keys import digest_file
from pipeline.workflow.store import Store, manifest_text

SITE = """rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}
motion: {kind: record, files: [../records/shake.csv], pga: [0.3, 0.6], processing: {order: none,
  highpass: null, lowpass: null}, unit: m/s2}
simulation: {engine: nonsmooth, time_step: 0.008}
"""


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory, quick_time_step: None) -> Path:
    """Results of a site in one folder whose record is in another."""
    folder = tmp_path_factory.mktemp("once")
    for name in ("sites", "records"):
        (folder / "there" / name).mkdir(parents=True)
    times = 0.01 * np.arange(201)
    sine, cosine = np.sin(0.5 * np.pi * times), np.cos(0.5 * np.pi * times)
    shaking = 12.0 * (3.0 * sine**2 * cosine**2 - sine**4)  # of a table that goes as sin^4
    rows = "".join(f"{t:.2f},{a:.6f}\n" for t, a in zip(times, shaking, strict=True))
    (folder / "there" / "records" / "shake.csv").write_text("time,acceleration\n" + rows)
    site = folder / "there" / "sites" / "stone.yaml"
    site.write_text(SITE)
    given = ["run", "responses", "--site", str(site), "--workers", "0"]
    assert cli.main([*given, "--derived", str(folder / "derived")]) == cli.DONE
    return folder


@pytest.fixture
def made(once: Path, tmp_path: Path) -> Path:
    """A copy of these results, and of what they were made from."""
    shutil.copytree(once, tmp_path, dirs_exist_ok=True)
    return tmp_path / "derived" / "stone"


@pytest.fixture
def bundle(made: Path, vsr: Callable[..., Ran], tmp_path: Path) -> Path:
    path = tmp_path / "study.zip"
    ran = vsr("export", made, "--to", path)
    assert ran.code == cli.DONE, ran.err
    return path


def test_its_readme_gives_a_command_whatever_the_name_of_the_site(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "-my stone.yaml").write_text(SITE.splitlines()[0])
    monkeypatch.chdir(tmp_path)
    assert cli.main(["run", "rock", "--site=-my stone.yaml", "--derived", "derived"]) == cli.DONE
    assert cli.main(["export", "derived/-my stone", "--to", "study.zip"]) == cli.DONE
    with zipfile.ZipFile("study.zip") as archive:
        (command,) = re.findall(r"vsr (run PRODUCT .*)", archive.read("README.md").decode())
        archive.extractall("unpacked")
    monkeypatch.chdir(tmp_path / "unpacked" / "inputs")
    assert cli.main(shlex.split(command.replace("PRODUCT", "rock"))) == cli.DONE


def test_one_that_was_packed_again_with_its_folders_is_whole(
    bundle: Path, vsr: Callable[..., Ran], tmp_path: Path
) -> None:
    """As ``zip -r`` does."""
    again = tmp_path / "again.zip"
    with zipfile.ZipFile(bundle) as archive, zipfile.ZipFile(again, "w") as packed:
        folders = {f"{part}/" for name in archive.namelist() for part in Path(name).parents}
        for name in sorted(folders - {"./"}):
            packed.writestr(name, b"")
        for name in archive.namelist():
            packed.writestr(name, archive.read(name), zipfile.ZIP_DEFLATED)
    ran = vsr("check", again)
    assert (ran.code, ran.err) == (cli.DONE, "")
    assert vsr("compare", bundle, again, "--to", tmp_path / "compared.html").code == cli.DONE


@pytest.mark.slow
def test_it_is_checked_and_made_again_elsewhere_with_the_same_bytes(
    made: Path,
    bundle: Path,
    vsr: Callable[..., Ran],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shutil.rmtree(tmp_path / "there")
    ran = vsr("check", bundle)
    assert (ran.code, ran.err) == (cli.DONE, "")
    elsewhere = tmp_path / "elsewhere"
    with zipfile.ZipFile(bundle) as archive:
        archive.extractall(elsewhere)
    about = json.loads((elsewhere / "bundle.json").read_text())
    monkeypatch.chdir(elsewhere / about["base"])
    again = tmp_path / "again"
    ran = vsr("run", "responses", "--site", about["site"], "--workers", "0", into=again)
    assert ran.code == cli.DONE, ran.err
    names = {path.name for path in (elsewhere / "results").glob("*.nc")}
    assert {"rock.nc", "motions.nc", "responses.nc"} <= names
    for name in names:
        assert digest_file(again / "stone" / name) == digest_file(made / name), name


def test_the_same_results_are_the_same_bytes_and_name_no_folder_of_a_machine(
    made: Path, bundle: Path, vsr: Callable[..., Ran], tmp_path: Path
) -> None:
    assert vsr("export", made, "--to", tmp_path / "twice.zip").code == cli.DONE
    assert (tmp_path / "twice.zip").read_bytes() == bundle.read_bytes()
    with zipfile.ZipFile(bundle) as archive:
        for name in archive.namelist():
            assert str(tmp_path).encode() not in archive.read(name), name


def test_the_crate_describes_every_file(bundle: Path) -> None:
    with zipfile.ZipFile(bundle) as archive:
        names = set(archive.namelist())
        crate = json.loads(archive.read(layout.CRATE))
        sizes = {one.filename: str(one.file_size) for one in archive.infolist()}
    assert crate["@context"] == "https://w3id.org/ro/crate/1.1/context"
    graph = {one["@id"]: one for one in crate["@graph"]}
    assert len(graph) == len(crate["@graph"])
    assert graph[layout.CRATE]["about"] == {"@id": "./"}
    root = graph["./"]
    assert {"name", "description", "datePublished", "license"} <= root.keys()
    parts = {part["@id"] for part in root["hasPart"]}
    assert parts == names - {layout.CRATE, layout.ABOUT, layout.SUMS}
    assert all(graph[name]["contentSize"] == sizes[name] for name in parts)
    used = {one["@id"] for key in ("object", "result") for one in graph["#made"][key]}
    assert used <= parts
    assert any(name.endswith("records/shake.csv") for name in used)


def test_inputs_that_may_not_be_given_are_told_by_their_digest(
    made: Path, vsr: Callable[..., Ran], tmp_path: Path
) -> None:
    path = tmp_path / "study.zip"
    assert "shake.csv" in vsr("export", made, "--to", path, "--digests").err
    with zipfile.ZipFile(path) as archive:
        assert not any("shake.csv" in name for name in archive.namelist())
    digest = digest_file(tmp_path / "there" / "records" / "shake.csv")
    ran = vsr("check", path)
    assert ran.code == cli.UNRESOLVED
    assert digest in ran.out


def changed(bundle: Path, name: str, change: Callable[[bytes], bytes]) -> None:
    """Put another content in place of a member's."""
    with zipfile.ZipFile(bundle) as archive:
        members = {one: archive.read(one) for one in archive.namelist()}
    members[name] = change(members.get(name, b""))
    with zipfile.ZipFile(bundle, "w", zipfile.ZIP_DEFLATED) as archive:
        for one, content in members.items():
            archive.writestr(one, content)


def test_a_changed_byte_and_another_version_are_told(
    bundle: Path, vsr: Callable[..., Ran], monkeypatch: pytest.MonkeyPatch
) -> None:
    def other(content: bytes) -> bytes:
        told = json.loads(content)
        del told["versions"]["scipy"]  # which some distributions spell SciPy
        told["versions"] |= {"python": "3.9.1", "numpy": "1.0", "SciPy": "1.0"}
        told["vsr"] = "0.0.1"
        return json.dumps(told).encode()

    changed(bundle, layout.ABOUT, other)
    ran = vsr("check", bundle)
    assert ran.code == cli.UNRESOLVED
    assert "and was 3.9.1: no product depends on it" in ran.out
    assert "and was 0.0.1: " in ran.out
    (scipy,) = [line for line in ran.out.splitlines() if line.startswith("SciPy is ")]
    assert "was 1.0: motions and rock depend on it" in scipy
    assert "of other versions here, without a product that depends on them: numpy" in ran.out
    changed(bundle, "results/responses.nc", lambda content: content[:-1] + b"?")
    ran = vsr("check", bundle)
    assert ran.code == cli.REFUSED
    (line,) = ran.err.splitlines()
    assert "results/responses.nc is not what was written" in line


def outside(archive: zipfile.ZipFile) -> None:
    archive.writestr("../outside.txt", "x")


def absolute(archive: zipfile.ZipFile) -> None:
    archive.writestr("/outside.txt", "x")


def link(archive: zipfile.ZipFile) -> None:
    member = zipfile.ZipInfo("results/link")
    member.external_attr = (stat.S_IFLNK | 0o777) << 16
    archive.writestr(member, "/etc/passwd")


def large(archive: zipfile.ZipFile) -> None:
    archive.writestr("results/zeros", b"x")
    archive.filelist[-1].file_size = 100 * 1024**3


def encrypted(archive: zipfile.ZipFile) -> None:
    archive.writestr("results/rock.nc", "x")
    archive.filelist[-1].flag_bits |= 1


def packed_otherwise(archive: zipfile.ZipFile) -> None:
    archive.writestr("results/rock.nc", "x", zipfile.ZIP_LZMA)


def twice_in_one_place(archive: zipfile.ZipFile) -> None:
    archive.writestr("inputs//etc/passwd", "x")


def schema(archive: zipfile.ZipFile) -> None:
    archive.writestr("bundle.json", '{"schema_version": 2}')


@pytest.mark.parametrize(
    "fault",
    [outside, absolute, link, large, encrypted, packed_otherwise, twice_in_one_place, schema],
)
def test_a_hostile_one_is_refused_in_a_line_and_nothing_is_written(
    fault: Callable[[zipfile.ZipFile], None], vsr: Callable[..., Ran], tmp_path: Path
) -> None:
    path = tmp_path / "in" / "study.zip"
    path.parent.mkdir()
    with zipfile.ZipFile(path, "w") as archive:
        fault(archive)
    ran = vsr("check", path)
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran.err
    assert [one for one in tmp_path.rglob("*") if one.is_file()] == [path]


def test_a_file_that_is_larger_than_it_says_is_never_unpacked(
    bundle: Path, vsr: Callable[..., Ran]
) -> None:
    """Declared as 1 kB in the archive's list, while 50 MB of zeros are packed."""
    with zipfile.ZipFile(bundle, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("results/zeros", bytes(50_000_000))
        archive.filelist[-1].file_size = 1000
    ran = vsr("check", bundle)
    assert ran.code == cli.REFUSED
    assert "results/zeros" in ran.err
    assert layout.digest(zipfile.ZipFile(bundle), "results/zeros") == ""


def resealed(bundle: Path, name: str, change: Callable[[bytes], bytes]) -> None:
    """Change a member, and its checksum with it."""
    changed(bundle, name, change)
    with zipfile.ZipFile(bundle) as archive:
        content = archive.read(name)

        told = json.loads(archive.read(layout.ABOUT))
    told["files"][name] = layout.sha256(content)
    changed(bundle, layout.ABOUT, lambda old: json.dumps(told).encode())
    changed(bundle, layout.SUMS, lambda old: layout.sums(told["files"]))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("results/responses.nc", "responses.nc is not what responses wrote"),
        ("results/.stages/responses.json", "tells nothing of responses"),
    ],
)
def test_what_its_stage_did_not_write_is_told_though_the_checksums_are_right(
    name: str, words: str, bundle: Path, vsr: Callable[..., Ran]
) -> None:
    resealed(bundle, name, lambda content: content[:-2] + b"??")
    ran = vsr("check", bundle)
    assert (ran.code, words in ran.err) == (cli.REFUSED, True), (ran.out, ran.err)


def passed_off(bundle: Path, name: str, content: bytes) -> None:
    """Put a file in place of a product, and its checksum into the manifest, too."""
    resealed(bundle, f"results/{name}", lambda old: content)

    def with_sum(manifest: bytes) -> bytes:
        told = json.loads(manifest)
        told["files"][name] = layout.sha256(content)
        return manifest_text(told).encode()

    resealed(bundle, f"results/.stages/{name.removesuffix('.nc')}.json", with_sum)


def test_what_is_passed_off_as_a_product_is_told(
    bundle: Path, vsr: Callable[..., Ran], tmp_path: Path
) -> None:
    with zipfile.ZipFile(bundle) as archive:
        rock = archive.read("results/rock.nc")
    for content, words in ((rock, "has another key than that"), (bytes(100), "is no dataset")):
        shutil.copy(bundle, tmp_path / "other.zip")
        passed_off(tmp_path / "other.zip", "responses.nc", content)
        ran = vsr("check", tmp_path / "other.zip")
        assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran
        assert f"results/responses.nc {words} of responses" in ran.err


def test_files_of_no_product_and_settings_without_their_file_are_told(
    bundle: Path, vsr: Callable[..., Ran]
) -> None:
    def without_file(manifest: bytes) -> bytes:
        return manifest_text(json.loads(manifest) | {"files": {}}).encode()

    resealed(bundle, "results/Responses.nc", lambda content: b"of somebody")
    ran = vsr("check", bundle)
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran
    assert "results/Responses.nc is of no product" in ran.err
    resealed(bundle, "results/.stages/settings.json", without_file)
    ran = vsr("check", bundle)
    assert ran.code == cli.REFUSED
    assert "results/.stages/settings.json does not name config.yaml" in ran.err
    assert "results/config.yaml is of no product" in ran.err


@pytest.mark.parametrize(
    ("name", "why"), [("inputs/" + "n" * 300, "File name too long"), ("inputs/more", "directory")]
)
def test_a_member_that_cannot_be_unpacked_is_named(
    name: str, why: str, bundle: Path, vsr: Callable[..., Ran]
) -> None:
    resealed(bundle, "inputs/more/one.csv", lambda content: b"")
    resealed(bundle, name, lambda content: b"")
    ran = vsr("check", bundle)
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran
    assert f": {name[:200]}" in ran.err
    assert why in ran.err


def test_a_site_that_is_refused_is_named_as_in_the_bundle(
    bundle: Path, vsr: Callable[..., Ran]
) -> None:
    with zipfile.ZipFile(bundle) as archive:
        told = json.loads(archive.read(layout.ABOUT))
    member = f"{told['base']}/{told['site']}"
    for content, words in ((b"yow: 3\n", f"{member}: yow: "), (b"yaw: [\n", f"{member}: ")):
        resealed(bundle, member, lambda old, content=content: content)
        ran = vsr("check", bundle)
        assert ran.code == cli.UNRESOLVED, ran
        lines = ran.out.splitlines()
        assert any(line.startswith(words) for line in lines), lines
        assert not any("/tmp" in line.replace(member, "") for line in lines), lines


def test_a_product_that_is_not_made_here_is_told(
    made: Path, vsr: Callable[..., Ran], tmp_path: Path
) -> None:
    facts = {"key": "k", "facts": {"config": {}, "needs": {}}, "unresolved": 0, "retry": 0}
    Store(made).publish("terrain", facts, {})
    assert vsr("export", made, "--to", tmp_path / "study.zip").code == cli.DONE
    ran = vsr("check", tmp_path / "study.zip")
    line = "terrain is not made of these settings on this machine"
    assert (ran.code, ran.out.splitlines()) == (cli.UNRESOLVED, [line])


def test_manifests_that_need_each_other_end_nothing(bundle: Path, vsr: Callable[..., Ran]) -> None:
    def circle(content: bytes) -> bytes:
        told = json.loads(content)
        facts = told["facts"] | {"needs": {"rock": ""}}
        return manifest_text(told | {"facts": facts}).encode()

    resealed(bundle, "results/.stages/rock.json", circle)
    assert vsr("check", bundle).code == cli.DONE


def test_a_name_in_no_encoding_and_a_pipe_are_refused(
    bundle: Path, vsr: Callable[..., Ran], tmp_path: Path
) -> None:
    content = bundle.read_bytes()
    with zipfile.ZipFile(bundle) as archive:
        at = archive.start_dir
    listed = bytearray(content[at:])
    listed[8:10] = (0x800).to_bytes(2, "little")  # its name is in UTF-8
    listed[46] = 0xA4
    bundle.write_bytes(content[:at] + bytes(listed))
    os.mkfifo(tmp_path / "pipe")
    for path in (bundle, tmp_path / "pipe"):
        ran = vsr("check", path)
        assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran.err


def test_results_written_anew_while_they_are_read_are_refused(
    made: Path, vsr: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Store, "damage", lambda *given: "")  # whole when it was looked at
    (made / "rock.nc").write_bytes(b"of another command")
    ran = vsr("export", made, "--to", tmp_path / "study.zip")
    assert (ran.code, "written anew" in ran.err) == (cli.REFUSED, True), ran.err
    assert not (tmp_path / "study.zip").exists()


def test_where_an_input_lies_is_no_part_of_a_product_but_what_it_holds_is(
    made: Path, vsr: Callable[..., Ran], tmp_path: Path
) -> None:
    record, site = tmp_path / "elsewhere" / "shake.csv", tmp_path / "own" / "pebble.yaml"
    record.parent.mkdir()
    site.parent.mkdir()
    shutil.copy(tmp_path / "there" / "records" / record.name, record)
    site.write_text(SITE.replace("../records/shake.csv", str(record)))
    run = partial(vsr, "run", "responses", "--site", site, "--workers", "0", into=made.parent)
    assert run().code == cli.DONE
    assert _key(made.with_name("pebble")) == _key(made)
    assert vsr("export", made.with_name("pebble"), "--to", tmp_path / "study.zip").code == cli.DONE
    ran = vsr("check", tmp_path / "study.zip")
    assert (ran.code, "changed" in ran.out) == (cli.DONE, False), ran.out
    record.write_text(record.read_text() + "2.01,0.0\n")
    assert run().code == cli.DONE
    assert _key(made.with_name("pebble")) != _key(made)


def _key(folder: Path) -> str:
    manifest = Store(folder).manifest("responses")
    assert manifest is not None
    return str(manifest["key"])


@pytest.mark.slow
def test_curves_in_folders_of_a_folder_are_in_it(
    write_site: Callable[..., str], vsr: Callable[..., Ran], derived: Path, tmp_path: Path
) -> None:
    curves = tmp_path / "model" / "PGA" / "curves.csv"
    curves.parent.mkdir(parents=True)
    curves.write_text("name,lon,lat,0.01,0.1,1.0\nhere,-120.9,35.2,2.0e-1,4.0e-3,2.0e-5\n")
    curves.with_name("notes.docx").touch()  # which nothing reads, and no bundle holds
    (curves.parent / "old").mkdir()
    shutil.copy(curves, curves.parent / "old" / "copy.csv")  # as one that is read
    ratio = "{pga: [0.1], median: [0.2], log_sd: [0.3]}"
    age = "{kind: normal, mean: 3000}"
    site = write_site(
        "motion: {pga: [0.2, 0.4, 0.8], pgv_pga: [0.2]}\nuncertainty: {members: 0}\n"
        f"hazard: {{curves: model, age: {age}, pgv_pga: {ratio}}}\n"
    )
    assert vsr("run", "hazard", "--site", site, "--workers", "0").code == cli.DONE
    ran = vsr("export", derived / "rock", "--to", tmp_path / "study.zip")
    assert (ran.code, "is not in it" in ran.err) == (cli.DONE, False), ran.err
    ran = vsr("check", tmp_path / "study.zip")
    assert (ran.code, ran.err) == (cli.DONE, ""), ran.out
    curves.with_name("more.docx").touch()
    assert "file PGA/more.docx (not read) new" in vsr("why", "hazard", "--site", site).out


@pytest.mark.parametrize("share", slow_but([0.999], [0.0, 0.3, 0.999]))
def test_a_cut_one_is_refused(share: float, bundle: Path, vsr: Callable[..., Ran]) -> None:
    content = bundle.read_bytes()
    bundle.write_bytes(content[: int(share * len(content))])
    ran = vsr("check", bundle)
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran.err


def test_what_cannot_be_exported_is_refused(
    made: Path, vsr: Callable[..., Ran], tmp_path: Path
) -> None:
    for folder in (tmp_path / "nowhere", tmp_path / "there"):
        ran = vsr("export", folder, "--to", tmp_path / "study.zip")
        assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1)
    (made / "rock.nc").write_bytes(b"damaged")
    ran = vsr("export", made, "--to", tmp_path / "study.zip")
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1)
    assert not (tmp_path / "study.zip").exists()
