"""Binary glTF is read by its specification, whole or not at all."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.mesh_formats import ball, glb

from pipeline.stages.mesh import mesh_files
from vsr_core.errors import InvalidInput


def test_a_scene_of_lines_alone_is_refused(tmp_path: Path) -> None:
    def lines(scene: dict[str, Any]) -> dict[str, Any]:
        scene["meshes"][0]["primitives"][0]["mode"] = 1
        return scene

    glb(tmp_path / "rock.glb", lines)
    with pytest.raises(InvalidInput, match="a file without faces"):
        mesh_files.read(tmp_path / "rock.glb")


def test_morph_targets_without_weight_are_read(tmp_path: Path) -> None:
    def unused(scene: dict[str, Any]) -> dict[str, Any]:
        (mesh,) = scene["meshes"]
        (part,) = mesh["primitives"]
        part["targets"] = [{"POSITION": part["attributes"]["POSITION"]}]
        return scene | {"meshes": [mesh | {"weights": [0.0]}]}

    glb(tmp_path / "rock.glb", unused)
    found = mesh_files.read(tmp_path / "rock.glb")
    assert found.volume == pytest.approx(ball().volume, rel=1e-6)


@pytest.mark.parametrize("unit", ["metre", 5, "0 * m", "nan * m", ["m"]])
def test_a_unit_in_gltf_that_is_none_of_length_is_refused(tmp_path: Path, unit: object) -> None:
    def stated(scene: dict[str, Any]) -> dict[str, Any]:
        return scene | {"meshes": [one | {"extras": {"units": unit}} for one in scene["meshes"]]}

    glb(tmp_path / "rock.glb", stated)
    with pytest.raises(InvalidInput, match=r"a unit of .*; it is one of length"):
        mesh_files.read(tmp_path / "rock.glb")


SKEWED = [1.0, 0.3, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"extensionsRequired": ["KHR_mesh_quantization"]}, "extension KHR_mesh_quantization"),
        ({"meshes": [{"weights": [0.0, 1.0]}]}, "morph targets"),
        ({"nodes": [{"mesh": 0, "weights": [0.5]}]}, "morph targets"),
        ({"nodes": [{"mesh": 0, "skin": 0}]}, "a skin"),
        ({"nodes": [{"mesh": 0, "matrix": [1], "scale": [2]}]}, "a matrix and another move"),
        ({"nodes": [{"mesh": 0, "matrix": [*np.eye(4).ravel()[:15], 2.0]}]}, "that skews"),
        ({"nodes": [{"mesh": 0, "matrix": SKEWED}]}, "a matrix that skews"),
        ({"nodes": [{"children": [1]}, {"mesh": 0}], "scenes": [{"nodes": [0, 1]}]}, "two parents"),
        ({"nodes": [{"children": [2]}, {"children": [2]}, {"mesh": 0}]}, "two parents"),
        ({"nodes": [{"mesh": 0, "rotation": [0.0, 0.0, 0.0, 2.0]}]}, "whose length is not 1"),
        ({"meshes": [{"primitives": [{"mode": 6}]}]}, "strips or fans"),
        ({"scenes": [{"nodes": [0, 0]}]}, "two parents"),
        ({"buffers": [{"uri": "data:,AAAA"}]}, "coordinates in another file"),
    ],
)
def test_what_moves_deforms_or_packs_coordinates_is_refused(
    tmp_path: Path, more: dict[str, Any], told: str
) -> None:
    glb(tmp_path / "rock.glb", lambda scene: scene | more)
    with pytest.raises(InvalidInput, match=f"{told}.*; its coordinates are plain"):
        mesh_files.read(tmp_path / "rock.glb")


def test_a_gltf_rock_that_is_turned_and_scaled_is_read(tmp_path: Path) -> None:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec([0.3, 0.2, 0.1]).as_matrix() @ np.diag([1.0, 2.0, 3.0])
    columns = matrix.T.ravel().tolist()
    glb(tmp_path / "rock.glb", lambda scene: moved(scene, columns))
    found = mesh_files.read(tmp_path / "rock.glb")
    assert found.volume == pytest.approx(6.0 * ball().volume, rel=1e-5)


def in_two(scene: dict[str, Any]) -> dict[str, Any]:
    """A scene in which the ball is there twice, beside a camera, and at another a shift away."""
    camera = {"mesh": 0, "camera": 0, "translation": [3.0, 0.0, 0.0], "scale": [2.0, 2.0, -2.0]}
    nodes = [{"children": [1, 2]}, {"mesh": 0}, camera]
    return scene | {"nodes": nodes, "cameras": [{}], "scenes": [{"nodes": [0]}], "scene": 0}


def test_all_shapes_of_a_gltf_scene_are_read_or_none(tmp_path: Path) -> None:
    path = tmp_path / "rock.glb"
    glb(path, in_two)
    found = mesh_files.read(path)
    assert len(found.faces) == 2 * len(ball().faces)
    assert found.volume == pytest.approx(9.0 * ball().volume, rel=1e-5)
    far = 3.0 + 2.0 * ball().bounds[1, 0]
    assert found.bounds[1] == pytest.approx([far, *2.0 * ball().bounds[1, 1:]], rel=1e-5)
    nodes = [{"mesh": 0}, {"mesh": 0}]
    glb(path, lambda scene: scene | {"nodes": nodes, "scenes": [{"nodes": [0]}, {"nodes": [1]}]})
    with pytest.raises(InvalidInput, match="of 2 shapes of 1 meshes, not all of them in"):
        mesh_files.read(path)
    glb(path, lambda scene: in_two(scene) | {"scenes": [{"nodes": [-1]}]})
    with pytest.raises(InvalidInput, match="names nodes -1 of 3"):
        mesh_files.read(path)
    glb(path, lambda scene: scene | {"nodes": [{"mesh": 0, "scalE": [2.0, 2.0, 2.0]}]})
    with pytest.raises(InvalidInput, match="nodes with 'scalE'; a plain glTF file has none"):
        mesh_files.read(path)
    often = {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {}}}}
    glb(path, lambda scene: scene | {"nodes": [often], "extensionsUsed": ["EXT_mesh_gpu_instanc"]})
    with pytest.raises(InvalidInput, match="nodes with 'EXT_mesh_gpu_instancing'"):
        mesh_files.read(path)


def test_units_of_shapes_in_gltf_are_one(tmp_path: Path) -> None:
    def apart(scene: dict[str, Any]) -> dict[str, Any]:
        meshes = [scene["meshes"][0] | {"extras": {"units": unit}} for unit in ("mm", "meters")]
        nodes = [{"mesh": 0}, {"mesh": 1}]
        return scene | {"meshes": meshes, "nodes": nodes, "scenes": [{"nodes": [0, 1]}], "scene": 0}

    glb(tmp_path / "rock.glb", apart)
    with pytest.raises(InvalidInput, match="shapes in meters and mm; their unit is one"):
        mesh_files.read(tmp_path / "rock.glb")


def test_a_map_in_single_precision_is_coarse_wherever_a_scene_puts_it(tmp_path: Path) -> None:
    back = np.eye(4)
    back[0, 3] = -4e6
    mesh = ball().apply_translation([4e6, 0.0, 0.0])
    glb(tmp_path / "rock.glb", lambda scene: moved(scene, back.T.ravel().tolist()), mesh)
    with pytest.raises(InvalidInput, match=r"single precision, in steps of 0\.25"):
        mesh_files.read(tmp_path / "rock.glb")


def test_lights_and_looks_of_gltf_change_no_shape(tmp_path: Path) -> None:
    looks = ["KHR_lights_punctual", "KHR_texture_transform", "EXT_texture_webp"]
    glb(tmp_path / "rock.glb", lambda scene: scene | {"extensionsRequired": looks})
    found = mesh_files.read(tmp_path / "rock.glb")
    assert found.volume == pytest.approx(ball().volume, rel=1e-6)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_colours_of_gltf_are_read(tmp_path: Path, kind: type) -> None:
    """Which tell rock and ground apart."""
    mesh, path = ball(), tmp_path / "rock.glb"
    shades = (255.0 * (mesh.vertices[:, 2:] > 0.0) * [1.0, 0.4, 0.2]).astype(np.uint8)
    mesh.visual.vertex_colors = shades
    code, largest = {np.uint8: (5121, 255), np.uint16: (5123, 65535), np.float32: (5126, 1.0)}[kind]
    data = (mesh.visual.vertex_colors / 255.0 * largest).round(7).astype(kind).tobytes()

    def coloured(scene: dict[str, Any]) -> dict[str, Any]:
        at = scene["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]
        scene["accessors"][at] |= {"componentType": code, "bufferView": len(scene["bufferViews"])}
        begin = scene["buffers"][0]["byteLength"] - len(data)
        scene["bufferViews"].append({"buffer": 0, "byteOffset": begin, "byteLength": len(data)})
        return scene

    glb(path, coloured, mesh, data)
    read = mesh_files.read(path)
    assert read.vertices == pytest.approx(mesh.vertices, abs=1e-6)
    assert np.abs(read.visual.vertex_colors[:, :3].astype(int) - shades).max() <= 1


def corners(change: dict[str, Any], at: int = 0) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """A scene in which what is said of the corners of faces, or of others, is another."""

    def changed(scene: dict[str, Any]) -> dict[str, Any]:
        accessors = [*scene["accessors"]]
        accessors[at] = accessors[at] | change
        return scene | {"accessors": accessors}

    return changed


@pytest.mark.parametrize(
    ("change", "at", "told"),
    [
        ({"componentType": 5126}, 0, "SCALAR 5126 in a glTF file; these are SCALAR 5121, "),
        ({"type": "VEC3"}, 0, "VEC3 512"),
        ({"byteOffset": 4}, 0, "they are in the file"),
        ({"count": 10_000_000}, 1, "they are in the file"),
        ({"count": 640}, 1, "faces of vertices 0 to 641, of 640"),
        ({"count": -3}, 0, "they are in the file"),
        ({"sparse": {}}, 1, "sparse numbers in a glTF file"),
    ],
)
def test_numbers_of_gltf_that_are_none_of_its_shape_are_refused(
    tmp_path: Path, change: dict[str, Any], at: int, told: str
) -> None:
    glb(tmp_path / "rock.glb", corners(change, at))
    with pytest.raises(InvalidInput, match=told):
        mesh_files.read(tmp_path / "rock.glb")


def moved(scene: dict[str, Any], matrix: list[float]) -> dict[str, Any]:
    """A scene whose mesh has that matrix."""
    nodes = [node | {"matrix": matrix} if "mesh" in node else node for node in scene["nodes"]]
    return scene | {"nodes": nodes}


def test_gltf_of_another_version_is_refused(tmp_path: Path) -> None:
    content = ball().export(file_type="glb")
    (tmp_path / "rock.glb").write_bytes(content[:4] + b"\x01" + content[5:])
    with pytest.raises(InvalidInput, match="a file of glTF 1; it is glTF 2"):
        mesh_files.read(tmp_path / "rock.glb")
    (tmp_path / "rock.glb").write_bytes(content[:16] + b"TEXT" + content[20:])
    with pytest.raises(InvalidInput, match="whose first part is 'TEXT'; it is 'JSON'"):
        mesh_files.read(tmp_path / "rock.glb")


def test_coordinates_that_are_not_in_the_file_are_refused(tmp_path: Path) -> None:
    """Of a file that ends before its buffer, and says so."""
    content = ball().export(file_type="glb")
    length = int.from_bytes(content[12:16], "little")
    size = (20 + length).to_bytes(4, "little")
    (tmp_path / "rock.glb").write_bytes(content[:8] + size + content[12 : 20 + length])
    with pytest.raises(InvalidInput, match="of 15,360; they are in the file"):
        mesh_files.read(tmp_path / "rock.glb")


@pytest.mark.parametrize("far", [0.2, -0.2])
def test_coordinates_beyond_or_within_the_bounds_of_their_file_are_refused(
    tmp_path: Path, far: float
) -> None:
    def changed(scene: dict[str, Any]) -> dict[str, Any]:
        (part,) = scene["meshes"][0]["primitives"]
        bounds = scene["accessors"][part["attributes"]["POSITION"]]
        bounds["max"][2] += far
        del bounds["min"]
        return scene

    glb(tmp_path / "rock.glb", changed)
    with pytest.raises(InvalidInput, match="bounds are those of the coordinates"):
        mesh_files.read(tmp_path / "rock.glb")
