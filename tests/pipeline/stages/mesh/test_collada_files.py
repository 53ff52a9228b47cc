"""COLLADA is read by its specification, whole or not at all."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from support.bad_input import bounded
from support.mesh_formats import ball
from trimesh.exchange.dae import export_collada

from pipeline.stages.mesh import mesh_files
from vsr_core.errors import InvalidInput


def test_a_unit_in_the_file_is_that_of_the_scale(tmp_path: Path) -> None:
    path = tmp_path / "rock.dae"
    path.write_bytes(of_unit(export_collada([ball(), ball()]), b'name="inch" meter="0.0254"'))
    with pytest.raises(InvalidInput, match=r"unit of 0.0254 m.*rock.scale: 0.0254"):
        mesh_files.read(path)
    assert mesh_files.read(path, 0.0254).extents == pytest.approx([0.0254] * 3, rel=1e-3)
    with pytest.raises(InvalidInput, match=r"unit of 0.0254 m .*, and rock.scale: 0.01; they agr"):
        mesh_files.read(path, 0.01)


def two_in_collada() -> bytes:
    return export_collada([ball(), ball().apply_translation([3.0, 0.0, 0.0])])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda text: b"<p>0 </p><p>".join(text.rsplit(b"<p>", 1)),
            "1280 triangles whose corners are others",
        ),
        (
            lambda text: text.replace(b"<accessor ", b'<accessor offset="3" ', 1),
            "from number 3 on in",
        ),
        (lambda text: text.replace(b'stride="3"', b'stride="6"', 1), "in steps of 6; they are X"),
        (
            lambda text: re.sub(rb'<geometry id="[^"]*"', b'<geometry id="a"', text),
            "two parts that are named 'a'",
        ),
        (
            lambda text: text.replace(b"<mesh>", b'<mesh><source id="a"/><source id="a"/>', 1),
            "two parts that are named 'a'",
        ),
        (
            lambda text: (
                text.replace(b'name="Y"', b'name="?"', 1)
                .replace(b'name="Z"', b'name="Y"', 1)
                .replace(b'name="?"', b'name="Z"', 1)
            ),
            "they are X, Y, Z",
        ),
        (
            lambda text: re.sub(rb'(<input semantic="POSITION"[^>]*>)', rb"\1\1", text),
            "vertices at two places",
        ),
        (lambda text: of_unit(text, b'name="centimeter" meter="0,01"'), "'centimeter' of 0,01 m"),
        (lambda text: of_unit(text, b'name="centimeter" meter="1"'), "'centimeter' of 1 m"),
        (lambda text: of_unit(text, b'name="inches" meter="1"'), "'inches' of 1 m"),
        (lambda text: of_unit(text, b'name="kilometers" meter="1"'), "'kilometers' of 1 m"),
        (lambda text: of_unit(text, b'meter="1"/><unit meter="1"'), "there is one"),
        (
            lambda text: re.sub(b"<scene>.*?</scene>", b"", text, flags=re.DOTALL),
            "COLLADA 1.4.1 without a scene",
        ),
    ],
)
def test_a_geometry_that_cannot_be_read_is_not_left_out(
    tmp_path: Path, change: Callable[[bytes], bytes], words: str
) -> None:
    whole = two_in_collada()
    (tmp_path / "rock.dae").write_bytes(whole)
    assert mesh_files.read(tmp_path / "rock.dae").volume == pytest.approx(2.0 * ball().volume)
    assert change(whole) != whole
    (tmp_path / "rock.dae").write_bytes(change(whole))
    with pytest.raises(InvalidInput, match=words):
        mesh_files.read(tmp_path / "rock.dae")


def of_unit(text: bytes, unit: bytes) -> bytes:
    """A COLLADA file of that unit."""
    return text.replace(b"<up_axis>", b"<unit " + unit + b"/><up_axis>")


@pytest.mark.parametrize(
    "change",
    [
        lambda text: b"<p><!-- x -->".join(text.rsplit(b"<p>", 1)),
        lambda text: re.sub(rb"<library_effects>.*</library_effects>", b"", text),
        lambda text: text.replace(b'target="#', b'target="#no', 1),
    ],
)
def test_a_shape_does_not_need_its_material(
    tmp_path: Path, change: Callable[[bytes], bytes]
) -> None:
    """Nor that nothing is remarked among its numbers."""
    assert change(two_in_collada()) != two_in_collada()
    (tmp_path / "rock.dae").write_bytes(change(two_in_collada()))
    assert mesh_files.read(tmp_path / "rock.dae").volume == pytest.approx(2.0 * ball().volume)


@pytest.mark.parametrize(
    ("move", "words"),
    [
        ("<matrix>.5 0 0 0 0 .5 0 0 0 0 .5 0 0 0 0</matrix>", "matrix of .*16 numbers"),
        ("<matrix>.5 0 0 0 0 .5 0 0 0 0 .5 0 0 0 0 2</matrix>", "the last of them 0 0 0 1"),
        ("<scale>0.5 0.5</scale>", "scale of '0.5 0.5'; it has 3 numbers"),
        ("<scale>0.5 0.5 x</scale>", "3 numbers"),
        ("<scale>0_5 1 1</scale>", "3 numbers"),  # all of which Python reads
        ("<scale>0.5\N{NO-BREAK SPACE}1 1</scale>", "3 numbers"),
        ("<rotate>0 0 1 \N{FULLWIDTH DIGIT THREE}0</rotate>", "4 numbers"),
        ("<scalf>2 2 2</scalf>", "a node with a 'scalf'; a node has none"),
        ("<translate>1 0 nan</translate>", "3 numbers"),
        ("<rotate>0 0 2 90</rotate>", "an axis of length 1"),
        ("<skew>30 1 0 0 0 1 0</skew>", "a node with skew"),
        ("<lookat>0 0 0 0 0 -1 0 2 0</lookat>", "a node with lookat"),
        ('<instance_node url="#x"/>', "instance_node is of '#x', which cannot"),
        ('<node id="a"/><node id="a"/><instance_node url="#a"/>', "two parts that are named 'a'"),
        ('<instance_geometry url="#x"/>', "instance_geometry is of '#x', which cannot"),
        ('<instance_controller url="#x"/>', "a node with instance_controller"),
    ],
)
def test_a_part_of_a_scene_that_cannot_be_read_is_not_left_out(
    tmp_path: Path, move: str, words: str
) -> None:
    whole = export_collada(ball())
    at = whole.rindex(b"<instance_geometry")
    (tmp_path / "rock.dae").write_bytes(whole[:at] + move.encode() + whole[at:])
    with pytest.raises(InvalidInput, match=words):
        mesh_files.read(tmp_path / "rock.dae")


def test_moves_of_a_scene_count(tmp_path: Path) -> None:
    """Half as large, turned, and there twice by a name."""
    whole = export_collada(ball())
    start, end = whole.rindex(b"<node"), whole.rindex(b"</node>") + 7
    half = b'<node id="twice"><scale>0.5 0.5 0.5</scale><rotate>0 0.6 0.8 30</rotate>'
    more = b'</node><node><translate>9 0 0</translate><instance_node url="#twice"/></node>'
    (tmp_path / "rock.dae").write_bytes(
        whole[:start] + half + whole[start:end] + more + whole[end:]
    )
    found = mesh_files.read(tmp_path / "rock.dae")
    assert found.volume == pytest.approx(2.0 * 0.125 * ball().volume, rel=1e-5)


def test_a_scene_of_nodes_that_multiply_is_refused_at_once(tmp_path: Path) -> None:
    """Thirty nodes, each with two of the one before."""
    whole, doubling = export_collada(ball()).decode(), ""
    shape = re.search(r"<instance_geometry.*</instance_geometry>", whole, re.DOTALL)
    for n in range(1, 31):
        doubling += f'<node id="n{n}">' + 2 * f'<instance_node url="#n{n - 1}"/>' + "</node>"
    library = f'<library_nodes><node id="n0">{shape[0]}</node>{doubling}</library_nodes>'
    text = whole.replace("<library_visual_scenes>", f"{library}<library_visual_scenes>")
    text = text[::-1].replace(shape[0][::-1], '<instance_node url="#n30"/>'[::-1], 1)[::-1]
    (tmp_path / "rock.dae").write_text(text)
    with (
        bounded(seconds=5.0, mebibytes=300.0),
        pytest.raises(InvalidInput, match="more than 10,000 nodes in a scene"),
    ):
        mesh_files.read(tmp_path / "rock.dae")


def test_strips_and_fans_are_counted_by_their_faces(tmp_path: Path) -> None:
    """An octahedron of two fans about its poles."""
    points = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    fans = [[4, 0, 1, 2, 3, 0], [5, 0, 3, 2, 1, 0]]
    faces = [[fan[0], *fan[at : at + 2]] for fan in fans for at in range(1, 5)]
    whole = export_collada(trimesh.Trimesh(points, faces, process=False))
    both = "".join(f"<p>{' '.join(f'{one} {one}' for one in fan)}</p>" for fan in fans)
    text = re.sub(rb"<p>[^<]*</p>", both.encode(), whole)
    text = text.replace(b"triangles", b"trifans").replace(b'count="8"', b'count="2"')
    (tmp_path / "rock.dae").write_bytes(text)
    assert mesh_files.read(tmp_path / "rock.dae").volume == pytest.approx(4.0 / 3.0)
    strips = [[0, 1, 4, 2, 3], [3, 0, 4], [0, 5, 1], [1, 5, 2, 3], [0, 3, 5]]
    joined = "".join(f"<p>{' '.join(f'{one} {one}' for one in strip)}</p>" for strip in strips)
    (tmp_path / "rock.dae").write_bytes(
        text.replace(both.encode(), joined.encode())
        .replace(b"trifans", b"tristrips")
        .replace(b'count="2"', b'count="5"')
    )
    assert mesh_files.read(tmp_path / "rock.dae").volume == pytest.approx(4.0 / 3.0)
    (tmp_path / "rock.dae").write_bytes(re.sub(rb"</p><p>[^<]*</p>", b"</p>", text))
    with pytest.raises(InvalidInput, match="2 trifans whose corners are others"):
        mesh_files.read(tmp_path / "rock.dae")


def test_a_shape_beside_a_scene_is_not_left_out(tmp_path: Path) -> None:
    """Of COLLADA, one that nothing shows, that another scene shows, and that is no mesh."""
    whole = two_in_collada()
    last = whole.rindex(b"<instance_geometry")
    shown = whole[last : whole.index(b"</instance_geometry>", last) + 20]
    other = b'<visual_scene id="other"><node>' + shown + b"</node></visual_scene>"
    scenes = b"</library_visual_scenes>"
    for text in (
        whole.replace(shown, b""),
        whole.replace(scenes, other + scenes),
        whole.replace(b"<mesh>", b"<convex_mesh>", 1).replace(b"</mesh>", b"</convex_mesh>", 1),
    ):
        assert text != whole
        (tmp_path / "rock.dae").write_bytes(text)
        with pytest.raises(
            InvalidInput, match=r"shapes beside the scene|a geometry of 'convex_mesh'"
        ):
            mesh_files.read(tmp_path / "rock.dae")


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (rb"</p>", b"</p><p>0 1 2</p>", "1280 triangles whose corners are others"),
        (rb"<p>\d+", b"<p>-1", "1280 triangles whose corners are others"),
        (rb'offset="0"([^>]*"VERTEX")', rb'offset="x"\1', "not say where their vertices stand"),
        (rb'offset="0"([^>]*"VERTEX")', rb"\1", "not say where their vertices stand"),
        (rb'(<triangles[^>]*count=)"1280"', rb'\1"99999999999"', "99999999999 triangles whose"),
        (rb"(?s)<mesh>.*</mesh>", b"<brep/>", "a geometry of 'brep'"),
        (rb"(<geometry [^>]*>)", rb'\1<asset><unit name="inch" meter="0.0254"/></asset>', "a unit"),
        (
            rb'(<accessor [^>]*)source="#',
            rb'\1source="#other-',
            "of other numbers than those beside",
        ),
    ],
)
def test_a_collada_file_that_contradicts_itself_is_refused(
    tmp_path: Path, before: bytes, after: bytes, words: str
) -> None:
    whole = export_collada(ball())
    changed = re.sub(before, after, whole, count=1)
    assert changed != whole
    (tmp_path / "rock.dae").write_bytes(changed)
    with pytest.raises(InvalidInput, match=words):
        mesh_files.read(tmp_path / "rock.dae")


def test_a_collada_polylist_says_how_many_corners_each_face_has(tmp_path: Path) -> None:
    whole = export_collada(ball()).replace(b"triangles", b"polylist")
    sizes = b"3 " * len(ball().faces)
    for said, is_read in ((sizes, True), (sizes[:-2] + b"2", False), (sizes[2:], False)):
        text = whole.replace(b"<p>", b"<vcount>" + said + b"</vcount><p>")
        (tmp_path / "rock.dae").write_bytes(text)
        if is_read:
            read = mesh_files.read(tmp_path / "rock.dae")
            assert read.volume == pytest.approx(ball().volume, rel=1e-5)
        else:
            with pytest.raises(InvalidInput, match="1280 polylist whose corners are others"):
                mesh_files.read(tmp_path / "rock.dae")


def test_guiding_lines_beside_a_rock_are_left_out(tmp_path: Path) -> None:
    lines = b'<geometry id="guide"><mesh><linestrips count="1"/></mesh></geometry>'
    whole = export_collada(ball()).replace(b"<library_geometries>", b"<library_geometries>" + lines)
    assert lines in whole
    (tmp_path / "rock.dae").write_bytes(whole)
    assert mesh_files.read(tmp_path / "rock.dae").volume == pytest.approx(ball().volume, rel=1e-5)


def test_a_coordinate_of_collada_that_is_no_number_is_refused(tmp_path: Path) -> None:
    text = export_collada(ball()).decode()
    at = text.index("<float_array")
    changed = text[:at] + re.sub(r">\s*\S+ ", ">NaN ", text[at:], count=1)
    (tmp_path / "rock.dae").write_text(changed)
    with pytest.raises(InvalidInput, match="a coordinate 'NaN'; it is a number"):
        mesh_files.read(tmp_path / "rock.dae")


def test_colours_of_collada_are_read(tmp_path: Path) -> None:
    mesh = ball()
    mesh.visual.vertex_colors = (255.0 * (mesh.vertices[:, 2:] > 0.0) * [1.0, 0.4, 0.2]).astype(int)
    (tmp_path / "rock.dae").write_bytes(export_collada(mesh))
    read = mesh_files.read(tmp_path / "rock.dae")
    assert (len(read.vertices), read.is_watertight) == (len(mesh.vertices), True)
    assert read.visual.kind == "vertex"
    upper = read.vertices[:, 2] > 1e-6
    shades = np.unique(read.visual.vertex_colors[upper, :3], axis=0)
    assert shades == pytest.approx(np.array([[255, 102, 51]]), abs=1)


def test_colours_of_collada_beyond_their_range_are_refused(tmp_path: Path) -> None:
    """As those from 0 to 255, which would come round."""
    mesh = ball()
    mesh.visual.vertex_colors = np.full((len(mesh.vertices), 3), 255, dtype=np.uint8)
    whole = export_collada(mesh).decode()
    name = re.search(r'semantic="COLOR" source="#([^"]*)"', whole)[1]
    at = whole.index(f'id="{name}"')
    changed = whole[:at] + re.sub(r"\b1(\.0)?\b(?= )", "255", whole[at:], count=1)
    assert changed != whole
    (tmp_path / "rock.dae").write_text(changed)
    with pytest.raises(InvalidInput, match=r"colours from .* they are from 0 to 1"):
        mesh_files.read(tmp_path / "rock.dae")
