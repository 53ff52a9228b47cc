"""PLY files hold what their header says."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest
from support.bad_input import bounded
from support.mesh_formats import ball, ply

from pipeline.stages.mesh import mesh_files
from vsr_core.errors import InvalidInput


@pytest.mark.parametrize(("order", "named"), [("<", "little"), (">", "big")])
def test_a_binary_ply_of_triangles_and_quadrilaterals_is_read(
    tmp_path: Path, order: str, named: str
) -> None:
    """As Blender writes it: a pyramid of 1 x 1 x 1.5 m."""
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1.5)]
    faces = [(3, 2, 1, 0), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
    head = f"ply\nformat binary_{named}_endian 1.0\nelement vertex 5\n"
    head += "".join(f"property float {name}\n" for name in "xyz") + "property uchar red\n"
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    data = b"".join(struct.pack(f"{order}3fB", *point, 200) for point in points)
    data += b"".join(struct.pack(f"{order}B{len(one)}i", len(one), *one) for one in faces)
    path = tmp_path / "rock.ply"
    path.write_bytes(head.encode() + data)
    found = mesh_files.read(path)
    assert (len(found.faces), found.is_watertight) == (6, True)
    assert found.volume == pytest.approx(0.5)
    for other in (data[:-1], data + b"\0"):
        path.write_bytes(head.encode() + other)
        with pytest.raises(InvalidInput, match="other faces than the 5 that"):
            mesh_files.read(path)


def test_a_binary_ply_of_faces_of_three_corners_on_average_is_read(tmp_path: Path) -> None:
    """A wedge whose faces have four, three and five corners, with a colour and another list each.

    By its length all might be of as many corners as the first.
    """
    points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1.5, 0), (0, 1, 0)]
    points += [(x, y, 1) for x, y, _ in points]
    sides = [(at, (at + 1) % 5, (at + 1) % 5 + 5, at + 5) for at in range(5)]
    split = [part for one in sides[:1] for part in (one[:3], (one[0], *one[2:]))]
    faces = [*sides[1:], (4, 3, 2, 1, 0), (5, 6, 7, 8, 9), *split]
    assert sum(map(len, faces)) == 4 * len(faces)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property double {name}\n" for name in "xyz")
    head += f"element face {len(faces)}\nproperty uchar red\n"
    head += "property list int int vertex_indices\nproperty list uchar float other\nend_header\n"
    data = b"".join(struct.pack("<3d", *point) for point in points)
    for one in faces:
        data += struct.pack(f"<Bi{len(one)}iBf", 7, len(one), *one, 1, 0.5)
    (tmp_path / "rock.ply").write_bytes(head.encode() + data)
    found = mesh_files.read(tmp_path / "rock.ply")
    assert (found.is_watertight, found.volume) == (True, pytest.approx(2.0 + 0.5))


def test_a_binary_ply_of_lists_of_no_length_is_refused_at_once(tmp_path: Path) -> None:
    """Of lengths below 0, by which a reader would go backwards."""
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
    head += "".join(f"property float {name}\n" for name in "xyz")
    head += "element face 2000000000\nproperty list char int vertex_indices\nend_header\n"
    (tmp_path / "rock.ply").write_bytes(head.encode() + bytes(13) + b"\xff" * 10_000)
    with bounded(seconds=5.0, mebibytes=100.0), pytest.raises(InvalidInput, match="list of no l"):
        mesh_files.read(tmp_path / "rock.ply")


def test_lengths_of_lists_may_be_written_with_a_point(tmp_path: Path) -> None:
    text = ply("ascii").replace(b"list uchar int", b"list float int").replace(b"\n3 ", b"\n3.0 ")
    (tmp_path / "rock.ply").write_bytes(text)
    assert mesh_files.read(tmp_path / "rock.ply").volume == pytest.approx(ball().volume, rel=1e-5)


@pytest.mark.parametrize(
    ("kind", "value", "told"),
    [("int", "1.5", "x of '1.5'"), ("char", "150", "from -128 to 127"), ("int", "1", "")],
)
def test_coordinates_of_text_are_whole_numbers_where_its_header_says_so(
    tmp_path: Path, kind: str, value: str, told: str
) -> None:
    """A prism of four corners, one of which would be cut, or wrap round."""
    head = f"ply\nformat ascii 1.0\nelement vertex 4\nproperty {kind} x\nproperty float y\n"
    head += "property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
    faces = "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
    (tmp_path / "rock.ply").write_text(f"{head}0 0 0\n{value} 0 0\n0 1.5 0\n0 0 2.5\n{faces}")
    if told:
        with pytest.raises(InvalidInput, match=told):
            mesh_files.read(tmp_path / "rock.ply")
    else:
        assert mesh_files.read(tmp_path / "rock.ply").volume == pytest.approx(1.5 * 2.5 / 6.0)


def test_a_corner_of_a_face_of_text_is_a_whole_number(tmp_path: Path) -> None:
    text = ball().export(file_type="ply", encoding="ascii").decode()
    (tmp_path / "rock.ply").write_text(re.sub(r"(?m)^3 (\d+) ", r"3 \1.7 ", text, count=1))
    with pytest.raises(InvalidInput, match=r"a face of '\d+\.7'; its numbers are whole"):
        mesh_files.read(tmp_path / "rock.ply")


@pytest.mark.parametrize("has_colours", [True, False])
def test_a_binary_ply_beside_a_texture_is_read(tmp_path: Path, has_colours: bool) -> None:
    kinds = [(name, "<f4") for name in ("x", "y", "z", "s", "t")]
    kinds += [(name, "u1") for name in ("red", "green", "blue")] * has_colours
    points = np.zeros(3, dtype=kinds)
    points["x"], points["y"] = [0, 1, 0], [0, 0, 1]
    if has_colours:
        points["red"], points["blue"] = 200, [0, 1, 2]
    names = "".join(
        f"property {'uchar' if kind == 'u1' else 'float'} {name}\n" for name, kind in kinds
    )
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex 3\n{names}element face 1\n"
    head += "property list uchar int vertex_indices\nend_header\n"
    face = struct.pack("<B3i", 3, 0, 1, 2)
    (tmp_path / "rock.ply").write_bytes(head.encode() + points.tobytes() + face)
    read = mesh_files.read(tmp_path / "rock.ply")
    assert len(read.faces) == 1
    if has_colours:
        assert read.visual.vertex_colors[:, :3].tolist() == [[200, 0, at] for at in range(3)]


def test_colours_beside_textures_are_read(tmp_path: Path) -> None:
    """Of a text that Blender writes."""
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "s", "t"))
    names += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    head = f"ply\nformat ascii 1.0\nelement vertex 3\n{names}element face 1\n"
    points = "0 0 0 0 0 200 100 0\n1 0 0 0 1 200 100 1\n0 1 0 1 0 200 100 2\n"
    text = f"{head}property list uchar int vertex_indices\nend_header\n{points}3 0 1 2\n"
    (tmp_path / "rock.ply").write_text(text)
    shades = mesh_files.read(tmp_path / "rock.ply").visual.vertex_colors[:, :3]
    assert shades.tolist() == [[200, 100, 0], [200, 100, 1], [200, 100, 2]]
