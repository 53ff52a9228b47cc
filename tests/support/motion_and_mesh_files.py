"""Files of motions and of meshes, as a user may have them, and what is read of them."""

from __future__ import annotations

import io
import tempfile
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import obspy
import trimesh

from pipeline.config.motion_schema import RecordConfig
from pipeline.stages.mesh import mesh_files
from pipeline.stages.motions import record_inputs, table_motions
from pipeline.workflow.keys import digest_file
from tests.support import record_files
from vsr_core.motions.records import formats
from vsr_core.rock import solid
from vsr_core.scan.whole_rock import whole_rock

BOX = trimesh.creation.box((1.0, 1.0, 2.0))
MOTION = record_files.shaking(1, 100.0, 10.0, 6.0, 0.3)
TIMES = np.arange(60) * 0.01


@cache
def waveform(kind: str) -> bytes:
    header = {"delta": 0.01, "station": "A", "channel": "HNE"}
    content = io.BytesIO()
    obspy.Trace(MOTION.astype(np.float64), header).write(content, format=kind)
    return content.getvalue()


@cache
def recorded() -> bytes:
    """One channel of ObsPy's example, whose response `response` is."""
    content = io.BytesIO()
    obspy.read().select(channel="EHZ").write(content, format="MSEED")
    return content.getvalue()


@cache
def response() -> bytes:
    content = io.BytesIO()
    inventory = obspy.read_inventory().select(station="RJOB", channel="EHZ")
    inventory.write(content, format="STATIONXML")
    return content.getvalue()


@cache
def netcdf() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "one.nc"
        record_files.netcdf(path, MOTION, 0.01)
        return path.read_bytes()


RECORDS: dict[str, Callable[[], bytes]] = {
    "one.csv": lambda: record_files.csv(MOTION, 0.01).encode(),
    "one.at2": lambda: record_files.at2(MOTION, 0.01).encode(),
    "one.v2": lambda: record_files.cosmos((MOTION, 90), interval=0.01).encode(),
    "one.ns": lambda: record_files.knet(MOTION, 0.01).encode(),
    "one.mseed": lambda: waveform("MSEED"),
    "one.sac": lambda: waveform("SAC"),
    "one.nc": netcdf,
}


Array = np.ndarray[Any, Any]


def read_record(path: Path) -> Array:
    """Its samples, and their time step."""
    states_none = path.suffix in (".mseed", ".sac")
    motion = RecordConfig.model_validate(
        {
            "files": path.name,
            "unit": "m/s2" if states_none else None,
            "processing": {"order": "standard", "highpass": 0.1, "lowpass": 25.0},
            "pga": 0.5,
        }
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        record = record_inputs._ready(path, digest_file(path), None, motion).record
    return np.append(record.interval, record.acceleration)


def read_response(path: Path) -> Array:
    """A record without the response in a file, and its time step."""
    how = formats.Reading(None, None, path.read_bytes(), (0.5, 1.0, 20.0, 30.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        record = formats.read(recorded(), ".mseed", how)
    return np.append(record.interval, record.acceleration)


def read_mesh(path: Path) -> Array:
    """Vertices of its faces."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rock = whole_rock(lambda: mesh_files.read(path), "caps", str).rock
        solid.from_mesh(rock, 2000.0)
    return np.asarray(rock.vertices[rock.faces])


def read_table(path: Path) -> Array:
    """Its samples."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = table_motions.load(path)
    return np.column_stack([found.time, found.samples])


def table() -> bytes:
    there = 50.0 * np.sin(np.pi * TIMES / TIMES[-1]) ** 4
    rows = [f"{t:.4f},{x:.5f},{0.02 * x:.5f}" for t, x in zip(TIMES, there, strict=True)]
    return "\n".join(["time [s],x [mm],roll [degree]", *rows]).encode()


def mesh(kind: str) -> bytes:
    content = BOX.export(file_type=kind)
    return content.encode() if isinstance(content, str) else content


DOORS: dict[str, tuple[Callable[[], bytes], Callable[[Path], Array]]] = {
    **{name: (content, read_record) for name, content in RECORDS.items()},
    "response.xml": (response, read_response),
    "table.csv": (table, read_table),
    **{
        f"rock.{kind}": ((lambda kind=kind: mesh(kind)), read_mesh)
        for kind in ("ply", "stl", "obj", "dae", "glb")
    },
}


PLAIN = "processing: {order: none, highpass: null, lowpass: null}, pga: 1}\n"


def words_of(folder: Path, name: str) -> list[str]:
    """A command that reads a file; its site is written."""
    box, key = "rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}\n", ""
    unit = ", unit: m/s2" if name.endswith(("mseed", "sac")) else ""
    if name == "table.csv":
        key = f"motion: {{kind: table, files: {name}, pga: 1}}\n"
    elif name == "response.xml":
        (folder / "one.mseed").write_bytes(recorded())
        told = f"response: {{file: {name}, corners: [0.5, 1, 20, 30]}}"
        key = f"motion: {{kind: record, files: one.mseed, {told}, {PLAIN}"
    elif name in RECORDS:
        key = f"motion: {{kind: record, files: {name}{unit}, {PLAIN}"
    else:
        box = f"rock: {{shape: mesh, mesh: {name}, density: 2000}}\n"
    (folder / "site.yaml").write_text(box + key)
    product = "motions" if key else "rock"
    return ["run", product, "--site", str(folder / "site.yaml"), "--workers", "0"]
