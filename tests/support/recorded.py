"""Samples and files of records for tests."""

from __future__ import annotations

import io
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from support import record_files as files
from vsr_core.errors import InvalidInput
from vsr_core.motions.records.formats import Reading
from vsr_core.motions.records.record import Record

VALUES = files.shaking(7, 100.0, 4.0, 4.0, 0.6)


STEP = 0.01


PLAIN = Reading()


def record(values, interval: float = STEP) -> Record:
    return Record(np.asarray(values, dtype=float), interval, ("x",), "", "made up", "m/s2")


def refusal(call, *words: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        call()
    said = str(caught.value)
    assert [word for word in words if word not in said] == [], said


def trace(data, start: float, channel: str = "HNE", calib: float = 1.0, **more) -> SimpleNamespace:
    """What is used of ObsPy's Trace."""

    class Stats(SimpleNamespace):
        def __contains__(self, name: str) -> bool:
            return hasattr(self, name)

    stats = Stats(
        network="XX", station="NWC", location="", channel=channel, delta=STEP, calib=calib,
        starttime=start, endtime=start + STEP * (len(data) - 1), **more,
    )  # fmt: skip
    return SimpleNamespace(data=data, stats=stats)


def by_fortran(value: float) -> str:
    """By G15.7: four blanks follow where no exponent stands."""
    size = abs(value)
    if not 0.1 <= size < 1e7:
        return f"{value:15.7E}"
    return f"{value:11.{6 - math.floor(math.log10(size))}f}    "


def sac(**header: object) -> bytes:
    """A SAC file of the values."""
    module = pytest.importorskip("obspy.io.sac")
    header = {"delta": STEP, "kstnm": "NWC"} | header
    trace = module.SACTrace(data=VALUES.astype("f4"), **header)
    file = io.BytesIO()
    trace.write(file)
    return file.getvalue()


def example(folder: str, name: str) -> bytes:
    """A file of ObsPy's own tests."""
    obspy = pytest.importorskip("obspy")
    path = Path(obspy.__file__).parent / folder / "tests" / "data" / name
    if not path.is_file():
        pytest.skip("this ObsPy came without its test data")
    return path.read_bytes()
