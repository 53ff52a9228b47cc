"""Scans, records and tables that are broken, or lie about themselves, are refused in a line."""

from __future__ import annotations

import os
import pickle
import struct
import tempfile
from collections.abc import Callable
from contextlib import nullcontext
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline import cli
from tests.support import record_files
from tests.support.bad_input import bounded, broken, cut, see_that_it_is_told
from tests.support.motion_and_mesh_files import (
    BOX,
    DOORS,
    MOTION,
    RECORDS,
    TIMES,
    Array,
    read_record,
    read_table,
    waveform,
    words_of,
)
from vsr_core.errors import InvalidInput
from vsr_core.motions.named_columns import LONGEST_NAME, of_text
from vsr_core.motions.records import formats

Refused = Callable[..., str]

PLY = (
    "ply\nformat {form} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n"
    "property float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
)
HUGE = 2_000_000_000


def site(folder: Path, mesh: str) -> Path:
    path = folder / "scan.yaml"
    path.write_text(f"rock: {{shape: mesh, mesh: {mesh}, density: 2000}}\n")
    return path


def obj(vertices: Any, faces: Any) -> bytes:
    lines = ["v {} {} {}".format(*vertex) for vertex in vertices]
    lines += ["f {} {} {}".format(*face) for face in faces]
    return "\n".join(lines).encode()


CORNERS, FACES = np.array(BOX.vertices), np.array(BOX.faces) + 1

MESHES: dict[str, tuple[bytes, str]] = {
    "ascii of 2e9.ply": (
        PLY.format(form="ascii", vertices=HUGE, faces=12).encode() + b"0 0 0\n",
        "a file of 1 lines where its header says 2000000012",
    ),
    "binary of 2e9.ply": (
        PLY.format(form="binary_little_endian", vertices=HUGE, faces=12).encode() + bytes(100),
        "a file of other faces",
    ),
    "triangles of 4e9.stl": (bytes(80) + struct.pack("<I", 2 * HUGE) + bytes(500), "facets"),
    "glb of 4 GiB.glb": (b"glTF" + struct.pack("<III", 2, 2**32 - 1, 2**32 - 1), "it is whole"),
    "noise.ply": (bytes(np.random.default_rng(1).bytes(5000)), "cannot be read"),
    "flat.obj": (obj(CORNERS * [1, 1, 0], FACES), "a flat mesh"),
    "in a line.obj": (obj(CORNERS * [1, 0, 0], FACES), "a flat mesh"),
    "far.obj": (obj(CORNERS + 1e12, FACES), "1e+12 m"),
    "huge.obj": (obj(CORNERS * 1e308, FACES), "coordinates up to 1e+308 m"),
    "nan.obj": (obj([["nan", 0, 0], *CORNERS[1:]], FACES), "a hole 2"),
}
SEEN = ("flat.obj", "in a line.obj", "nan.obj")
"""Those of which there is something to draw."""


@pytest.mark.parametrize("name", MESHES)
def test_mesh_is_refused(tmp_path: Path, refused: Refused, name: str) -> None:
    content, words = MESHES[name]
    (tmp_path / name).write_bytes(content)
    with bounded(seconds=3.0, mebibytes=300.0):
        where, page = site(tmp_path, name), "prep.html" if name in SEEN else ""
        refused("run", "rock", "--site", where, words=(name, "rock.mesh", words), page=page)


def test_faces_of_vertices_that_are_not_there(tmp_path: Path, refused: Refused) -> None:
    content = BOX.export(file_type="ply")
    at = content.index(b"end_header\n") + len(b"end_header\n") + 8 * 12  # past eight vertices
    assert content[at] == 3
    (tmp_path / "rock.ply").write_bytes(
        content[: at + 1] + struct.pack("<i", 4711) + content[at + 5 :]
    )
    words = ("rock.ply", "of vertices 0 to 4711, of 8")
    refused("run", "rock", "--site", site(tmp_path, "rock.ply"), words=words)


@pytest.mark.parametrize("key", ["rock.mesh", "motion.files", "motion.response.file"])
@pytest.mark.parametrize("name", ["loop.ply", "x" * 300 + ".ply", "a\0b.ply", "\\uDCFF.ply", ""])
def test_path_that_leads_nowhere(tmp_path: Path, refused: Refused, key: str, name: str) -> None:
    (tmp_path / "loop.ply").symlink_to("loop.ply")
    text = {
        "rock.mesh": 'rock: {{shape: mesh, mesh: "{}", density: 2000}}\n',
        "motion.files": "motion: {{kind: record, files: '{}', pga: 1, {}}}\n",
        "motion.response.file": "motion: {{kind: record, files: one.mseed, response: {{file: '{}', "
        "corners: [0.1, 0.2, 20, 30]}}, pga: 1, {}}}\n",
    }[key].replace("'{}'", '"{}"')
    processing = "processing: {order: none, highpass: null, lowpass: null}"
    escaped = name.replace("\0", "\\0")
    path = tmp_path / "site.yaml"
    box = "" if key == "rock.mesh" else "rock: {shape: box, size: [1, 1, 2], density: 2000}\n"
    path.write_text(box + text.format(escaped, processing))
    (tmp_path / "one.mseed").write_bytes(waveform("MSEED"))
    refused("plan", "--site", path, words=("site.yaml",))


def taken_or_refused(path: Path, content: bytes, read: Callable[[Path], Array]) -> Array | None:
    """What is read of a file; None where it is refused."""
    path.write_bytes(content)
    with bounded(seconds=3.0, mebibytes=300.0):
        try:
            return read(path)
        except InvalidInput as error:
            said = error
    assert said.given
    assert said.rule
    assert said.remedy
    return None


SOME = settings(
    max_examples=500,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@cache
def whole(name: str) -> bytes:
    """Content of a whole file."""
    return DOORS[name][0]()


@cache
def sound(name: str) -> Array:
    """What is read of a whole file."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / name).write_bytes(whole(name))
        return DOORS[name][1](Path(folder) / name)


def see(folder: Path, name: str, data: Any) -> None:
    """Take or refuse a damaged file; one that is cut is refused, or is as the whole one.

    Of a plain table rows may be missing, and the last number may be cut.
    """
    is_cut = data.draw(st.booleans())
    damaged = data.draw((cut if is_cut else broken)(whole(name)))
    found = taken_or_refused(folder / name, damaged, DOORS[name][1])
    if found is None or not is_cut:
        return
    if name.endswith(".csv"):
        np.testing.assert_array_equal(found[:-1], sound(name)[: len(found) - 1])
    else:
        np.testing.assert_array_equal(found, sound(name))


@pytest.mark.parametrize("name", DOORS)
@SOME
@given(data=st.data())
def test_broken_file_is_taken_or_refused(tmp_path: Path, name: str, data: Any) -> None:
    see(tmp_path, name, data)


@pytest.mark.slow
@pytest.mark.parametrize("name", DOORS)
@settings(SOME, max_examples=20_000, derandomize=False, print_blob=True)
@given(data=st.data())
def test_hunt_of_broken_files(tmp_path: Path, name: str, data: Any) -> None:
    see(tmp_path, name, data)


@pytest.mark.parametrize("name", DOORS)
@settings(SOME, max_examples=3)
@given(data=st.data())
def test_a_command_refuses_a_broken_file_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, data: Any
) -> None:
    words = words_of(tmp_path, name)
    (tmp_path / name).write_bytes(data.draw(broken(whole(name))))
    capsys.readouterr()
    code = cli.main([*words, "--derived", str(tmp_path / "derived")])
    see_that_it_is_told(code, capsys.readouterr().err)


def test_a_time_that_no_calendar_has_is_refused(tmp_path: Path) -> None:
    content = bytearray(waveform("SAC"))
    content[20:24] = struct.pack("<f", 1e15)  # seconds from the reference time to the beginning
    (tmp_path / "one.sac").write_bytes(content)
    with pytest.raises(InvalidInput):
        read_record(tmp_path / "one.sac")


class Runs:
    """What a pickle does when it is read."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return (os.mkdir, (str(self.path),))


@pytest.mark.parametrize("name", ["one.sac", "one.mseed", "one.csv"])
def test_record_runs_nothing(tmp_path: Path, name: str) -> None:
    """ObsPy takes Python's pickles for records where it is left to find out the format."""
    (tmp_path / name).write_bytes(pickle.dumps(Runs(tmp_path / "made")))
    with pytest.raises(InvalidInput):
        read_record(tmp_path / name)
    assert not (tmp_path / "made").exists()


def rows(times: Any, values: Any, names: str = "time [s],acceleration [m/s2]") -> str:
    return "\n".join([names, *(f"{t!r},{v!r}" for t, v in zip(times, values, strict=True)), ""])


def late(when: float) -> str:
    times = [*(0.01 * np.arange(len(MOTION))).tolist(), when]
    return rows(times, [*MOTION.tolist(), 0.0])


EVEN = (0.01 * np.arange(len(MOTION))).tolist()
WRONG_RECORDS = {
    "a sample in a year.csv": (late(3e7), r"span 3e\+09 samples"),
    "a sample at the end of time.csv": (late(1e300), "samples"),
    "steps of nothing.csv": (rows([1e-305 * t for t in EVEN], MOTION.tolist()), "time steps of"),
    "steps of days.csv": (rows([1e7 * t for t in EVEN], MOTION.tolist()), "time steps of"),
    "NPTS of 1500 digits.at2": (
        record_files.at2(MOTION, 0.01).replace("NPTS=   1000", "NPTS= " + "9" * 1500),
        "samples",
    ),
    "no step.at2": (record_files.at2(MOTION, 0.01).replace("DT=  .0100", "DT=  .0000"), "steps of"),
}


@pytest.mark.parametrize("name", WRONG_RECORDS)
def test_record_is_refused(tmp_path: Path, name: str) -> None:
    text, words = WRONG_RECORDS[name]
    (tmp_path / name).write_text(text)
    with bounded(seconds=2.0, mebibytes=200.0), pytest.raises(InvalidInput, match=words):
        read_record(tmp_path / name)


@pytest.mark.parametrize("much", [" " * 60_000, " [" * 30_000, "[)" * 30_000, "[" * 60_000 + ")"])
@pytest.mark.parametrize("separator", [",", " "])
def test_names_of_columns_are_read_at_once(much: str, separator: str) -> None:
    """Or refused as long ones: 60,000 blanks in one took half a minute."""
    names = f"time{separator}acc{much}x"
    is_long = max(map(len, names.split(separator.strip() or None))) > LONGEST_NAME
    refusal = pytest.raises(InvalidInput, match="shorten it") if is_long else nullcontext()
    with bounded(seconds=1.0, mebibytes=50.0), refusal:
        assert of_text(names)[0].name == "time"
    within = f"time{separator}{names[-LONGEST_NAME:]}"
    assert of_text(within)[0].name == "time"
    assert [one[:2] for one in of_text("a (b) [ m ],c(d),e[[f],g]\n")] == [
        ("a (b)", "m"),
        ("c", "d"),
        ("e", "[f"),
        ("g]", None),
    ]


@pytest.mark.parametrize("lines", [("time," + 2_000_000 * "a,",), ("time,a", 2_000_000 * "1,")])
def test_a_line_of_a_table_is_bounded(lines: tuple[str, ...]) -> None:
    refusal = pytest.raises(InvalidInput, match=r"a line of 4,000,00\d characters; lines")
    with bounded(seconds=1.0, mebibytes=50.0), refusal:
        of_text("\n".join(lines))


def test_the_units_of_cosmos_are_read_at_once() -> None:
    text = record_files.cosmos((MOTION, 90), interval=0.01)
    text = text.replace("units=cm/sec2 (04)", 200_000 * "units=")
    with bounded(seconds=2.0, mebibytes=100.0):
        assert formats.read(text.encode(), ".v2", formats.Reading()).interval == 0.01


@pytest.mark.parametrize("name", ["one.at2", "one.v2", "one.ns"])
def test_record_that_is_cut_is_refused_wherever_it_is(name: str) -> None:
    content, suffix = RECORDS[name](), Path(name).suffix
    whole = formats.read_all(content, suffix, formats.Reading()).acceleration
    for length in [*range(100, len(content), 997), *range(len(content) - 100, len(content))]:
        try:
            found = formats.read_all(content[:length], suffix, formats.Reading())
        except InvalidInput:
            continue
        assert found.acceleration.tobytes() == whole.tobytes(), length


def test_record_shorter_than_its_header_says_is_refused() -> None:
    content = RECORDS["one.ns"]().replace(b"Duration Time(s)  10", b"Duration Time(s)  300")
    with pytest.raises(InvalidInput, match="1000 samples that says 30000"):
        formats.read_all(content, ".ns", formats.Reading())
    said = content.index(b"Duration Time(s)")
    with pytest.raises(InvalidInput, match="0 samples that says 0"):
        formats.read_all(content[:said] + b"Duration Time(s) 0", ".ns", formats.Reading())


def test_table_that_ends_in_a_number_is_refused() -> None:
    text = "time,acc_g\n0.00,0.1250\n0.01,0.2500\n0.02,0.25"
    with pytest.raises(InvalidInput, match="formed like no other"):
        formats.read_all(text.encode(), ".csv", formats.Reading())
    assert len(formats.read_all((text + "\n").encode(), ".csv", formats.Reading()).acceleration)


@pytest.mark.parametrize(
    ("time", "way", "words"),
    [
        (1e-300, 1.0, "time steps"),
        (1e300, 1.0, "time steps"),
        (1.0, 1e300, "m or rad"),
        (1.0, 1e-300, "m or rad"),
    ],
)
def test_table_motion_is_one_of_a_table(
    tmp_path: Path, time: float, way: float, words: str
) -> None:
    there = way * np.sin(np.pi * TIMES / TIMES[-1]) ** 4
    path = tmp_path / "table.csv"
    path.write_text(rows((time * TIMES).tolist(), there.tolist(), "time [s],x [m]"))
    with pytest.raises(InvalidInput, match=words):
        read_table(path)
