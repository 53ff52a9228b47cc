"""OBJ and STL of text are read line by line, each of the format and whole."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from support.bad_input import bounded
from support.mesh_formats import ball

from pipeline.stages.mesh import mesh_files
from vsr_core.errors import InvalidInput


def test_an_obj_of_a_million_blanks_is_read_at_once(tmp_path: Path) -> None:
    text = ball().export(file_type="obj") + "\nf" + " " * 1_000_000 + "1 2 3\n"
    (tmp_path / "rock.obj").write_text(text)
    with bounded(seconds=5.0, mebibytes=200.0):
        assert len(mesh_files.read(tmp_path / "rock.obj").faces) == len(ball().faces) + 1


@pytest.mark.parametrize(
    ("before", "after"), [(r"(?m)$", " # so"), (r" ", "\t"), (r"\n", "\r"), (r"\n", "\r\n")]
)
def test_an_obj_in_other_spellings_is_read(tmp_path: Path, before: str, after: str) -> None:
    text = re.sub(before, after, ball().export(file_type="obj"))
    (tmp_path / "rock.obj").write_bytes(text.encode())
    assert mesh_files.read(tmp_path / "rock.obj").volume == pytest.approx(ball().volume, rel=1e-6)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (r"(?m)^", " "),
        (r"(?m)^f", "fo"),
        (r"\A", "\ufeff"),
        (r"(?m)^f (.*)$", r"f \1\nusemtl none"),
        (r"(?m)^f (\d+) (\d+) (\d+)$", r"f \1//7 \2//7 \3//7"),
        (r"(?m)^(v .*)$", r"\1 1.0"),
    ],
)
def test_an_obj_in_still_other_spellings_is_read(tmp_path: Path, before: str, after: str) -> None:
    text = re.sub(before, after, ball().export(file_type="obj"))
    (tmp_path / "rock.obj").write_bytes(text.encode())
    assert mesh_files.read(tmp_path / "rock.obj").volume == pytest.approx(ball().volume, rel=1e-6)


def test_an_obj_of_faces_with_and_without_textures_is_read(tmp_path: Path) -> None:
    """A prism of six sides; its triangles with textures have as many numbers as its hexagons."""
    ring = [(np.cos(at), np.sin(at)) for at in np.arange(6) * np.pi / 3.0]
    lines = [f"v {x} {y} {z}" for z in (0, 2) for x, y in ring] + ["vt 0 0"]
    for at in range(6):
        a, b, c, d = at + 1, (at + 1) % 6 + 1, (at + 1) % 6 + 7, at + 7
        lines += [f"f {a}/1 {b}/1 {c}/1", f"f {a}/1 {c}/1 {d}/1"]
    lines += ["f 6 5 4 3 2 1", "f 7 8 9 10 11 12"]
    (tmp_path / "rock.obj").write_text("\n".join(lines))
    found = mesh_files.read(tmp_path / "rock.obj")
    assert found.is_watertight
    assert found.volume == pytest.approx(1.5 * np.sqrt(3.0) * 2.0)


def of_text(kind: str) -> str:
    """The ball as text; as STL in two solids."""
    if kind == "obj":
        return str(ball().export(file_type="obj"))
    parts = np.split(np.arange(len(ball().faces)), 2)
    halves = (ball().submesh([part], append=True) for part in parts)
    return "".join(str(half.export(file_type="stl_ascii")) + "\n" for half in halves)


@pytest.mark.parametrize(
    ("kind", "before", "after"),
    [
        ("obj", r"(?m)^f (\d+) \d+ (\d+)$", r"f \1 \2"),
        ("obj", r"(?m)^f (\d+) ", r"f \1/1 "),
        ("obj", r"(?m)^f (\d+) ", r"f \1.0 "),
        ("obj", r"(?m)^v (\S+) (\S+) \S+$", r"v \1 \2"),
        ("obj", r"(?m)^v (\S+) (\S+) ", r"v \1 1_0 "),
        ("obj", r"(?m)^f (\d+) ", r"face \1 "),
        ("obj", r"(?m)^f (\d+) ", r"\1 "),
        ("stl", r"endfacet(?!.*endfacet)(?s:.*)", ""),
        ("stl", r"endsolid(?!.*endsolid)(?s:.*)", ""),
        ("stl", r"(?s)outer loop.*?endloop", ""),
        ("stl", r"vertex.*\n", ""),
        ("stl", r"(vertex.*\n)", r"\1\1"),
        ("stl", r"vertex \S+ ", "vertex "),
        ("stl", r"vertex ", "vertices "),
    ],
)
def test_a_text_with_a_line_that_is_not_whole_is_refused(
    tmp_path: Path, kind: str, before: str, after: str
) -> None:
    path = tmp_path / f"rock.{kind}"
    whole = of_text(kind)
    path.write_text(whole)
    assert mesh_files.read(path).volume == pytest.approx(ball().volume, rel=1e-5)
    changed = re.sub(before, after, whole, count=1)
    assert changed != whole
    path.write_text(changed)
    with pytest.raises(InvalidInput, match=r"each is one of the format's|a file is whole"):
        mesh_files.read(path)


@pytest.mark.parametrize("face", ["f 1 2 0", "f 0 1 2", "f 1/1 2/1 0/1"])
def test_an_obj_face_of_vertex_0_is_refused(tmp_path: Path, face: str) -> None:
    """For trimesh it is the last one."""
    text = ball().export(file_type="obj")
    (tmp_path / "rock.obj").write_text(f"{text}\n{face}\n")
    with pytest.raises(InvalidInput, match="a face of vertex 0; the first vertex is 1"):
        mesh_files.read(tmp_path / "rock.obj")


def in_two_objects(mesh: trimesh.Trimesh, corner: str) -> str:
    """An OBJ text in which two faces, and then the rest, follow their own vertices."""
    lines, before = [], 0
    for own in (
        mesh.submesh([part], append=True) for part in np.split(np.arange(len(mesh.faces)), [2])
    ):
        lines += ["v {} {} {}\nvt 0 0".format(*vertex) for vertex in own.vertices]
        for face in own.faces:
            numbers = [(before + i + 1, i - len(own.vertices)) for i in face]
            lines.append("f " + " ".join(corner.format(first, back) for first, back in numbers))
        before += len(own.vertices)
    return "\n".join(lines)


@pytest.mark.parametrize("corner", ["{1}", "{1}/{1}", "\\\n{1}"])
def test_vertices_counted_back_from_the_face(tmp_path: Path, corner: str) -> None:
    """Wavefront's negative numbers: as the same counted from the beginning of the file."""
    path = tmp_path / "rock.obj"
    path.write_text(in_two_objects(ball(), "{0}"))
    first = mesh_files.read(path)
    path.write_text(in_two_objects(ball(), corner))
    back = mesh_files.read(path)
    np.testing.assert_array_equal(back.triangles, first.triangles)
    assert back.volume == pytest.approx(ball().volume)
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -2 -1\nv 0 0 1\n")
    with pytest.raises(InvalidInput, match="a face of vertex -4 after 3"):
        mesh_files.read(path)
