"""Shapes of a scene are one mesh, of bounded size."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.bad_input import bounded
from support.mesh_formats import ball, glb
from trimesh.exchange.dae import export_collada

from pipeline.stages.mesh import mesh_files
from vsr_core.errors import InvalidInput


@pytest.mark.parametrize("number", [20_000, 1_000])
def test_a_shape_that_stands_there_often_is_refused_at_once(tmp_path: Path, number: int) -> None:
    def often(scene: dict[str, Any]) -> dict[str, Any]:
        nodes = [{"mesh": 0}] * number
        return scene | {"nodes": nodes, "scenes": [{"nodes": [*range(number)]}]}

    glb(tmp_path / "rock.glb", often)
    part = b'<node><instance_geometry url="#shape"/></node>'
    text = re.sub(rb'<geometry id="[^"]*"', b'<geometry id="shape"', export_collada(ball()))
    text = re.sub(
        rb"<visual_scene.*</visual_scene>",
        b'<visual_scene id="scene">' + part * number + b"</visual_scene>",
        text,
        flags=re.DOTALL,
    )
    (tmp_path / "rock.dae").write_bytes(text)
    for kind in ("glb", "dae"):
        with bounded(seconds=10.0, mebibytes=300.0), pytest.raises(InvalidInput, match="in a scen"):
            mesh_files.read(tmp_path / f"rock.{kind}")


@pytest.mark.parametrize("kind", ["glb", "dae"])
def test_parts_of_one_list_of_vertices_are_one_surface(tmp_path: Path, kind: str) -> None:
    """As of several materials: of no vertex of which a part has none, a face is thought lost."""
    path, number = tmp_path / f"rock.{kind}", 8

    def parted(scene: dict[str, Any]) -> dict[str, Any]:
        (part,) = scene["meshes"][0]["primitives"]
        view, every = scene["accessors"][part["indices"]], []
        each = view["count"] // number
        for at in range(number):
            start = 4 * at * each
            scene["accessors"].append(view | {"count": each, "byteOffset": start})
            every.append(part | {"indices": len(scene["accessors"]) - 1})
        return scene | {"meshes": [{"primitives": every}]}

    if kind == "glb":
        glb(path, parted)
    else:
        whole = export_collada(ball())
        (part,) = re.findall(rb"<triangles.*?</triangles>", whole, re.DOTALL)
        words = re.findall(rb"<p>([^<]*)</p>", part)[0].split()
        texts = (
            b" ".join(words[at::1][: len(words) // number])
            for at in range(0, len(words), len(words) // number)
        )
        parts = (
            re.sub(rb"<p>[^<]*</p>", b"<p>" + text + b"</p>", part).replace(b'"1280"', b'"160"')
            for text in texts
        )
        path.write_bytes(whole.replace(part, b"".join(parts)))
    read = mesh_files.read(path)
    assert read.volume == pytest.approx(ball().volume, rel=1e-5)
    assert len(np.unique(read.faces)) == len(read.vertices)
