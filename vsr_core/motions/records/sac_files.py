"""SAC files: that header, samples and footer agree, and hold an acceleration.

By "SAC - Seismic Analysis Code: Users Manual" 102.0 (IRIS), "SAC Data File Format".
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import is_near

_OTHER = {6: "displacement", 7: "velocity", 50: "volts"}
"""Of IDEP."""

_SERIES = 1
"""Of IFTYPE: a time series, with LEVEN in even steps."""

_MEAN = 1e-4
"""Share of the peak by which DEPMEN may be off the mean, as in single precision."""

_HEADER, _SAMPLES, _VERSION = 632, 316, 304
"""Bytes of the header; where it has NPTS, and NVHDR."""

_FOOTER = 22 * 8
"""Bytes after the samples of version 7: 22 numbers of the header in double precision."""

_IN_HEADER = {0: 0, 1: 20, 2: 24}
"""Where the header has the footer's first numbers, DELTA, B and E, in single precision."""


def of_version_6(content: bytes) -> bytes:
    """A file of version 7, without its footer, as of version 6, which ObsPy reads.

    Raises
    ------
    InvalidInput
        If the footer contradicts the header, or its samples are not as many as it says.
    """
    for order in "<>":
        version, number = (
            int(np.frombuffer(content, f"{order}i4", 1, at)[0]) if len(content) >= _HEADER else 0
            for at in (_VERSION, _SAMPLES)
        )
        if version != 7:
            continue
        end = len(content) - _FOOTER
        if end != _HEADER + 4 * number:
            given = f"a SAC file of version 7 with {number} samples in {len(content)} bytes"
            raise InvalidInput(given, "it is whole", "download it again")
        footer = np.frombuffer(content, f"{order}f8", 22, end)
        for at, place in _IN_HEADER.items():
            said = float(np.frombuffer(content, f"{order}f4", 1, place)[0])
            if not np.isclose(said, footer[at], rtol=1e-6):
                given = f"a SAC file whose header says {said:g}, and its footer {footer[at]:g}"
                raise InvalidInput(given, "the two agree", "download it again")
        six = np.array(6, f"{order}i4").tobytes()
        return content[:_VERSION] + six + content[_VERSION + 4 : end]
    return content


def check_series(sac: Any) -> None:
    """Refuse a header of another kind of file, or whose times are not those of its samples."""
    if sac.get("iftype", _SERIES) != _SERIES or not sac.get("leven", True):
        given = "a SAC file of another kind (IFTYPE), or in uneven steps (LEVEN)"
        rule, remedy = "it is a motion in even steps of time", "use the record of the acceleration"
        raise InvalidInput(given, rule, remedy)
    if {"b", "e", "delta", "npts"} <= sac.keys() and sac["e"]:  # 0 where it was not filled in
        end = sac["b"] + (sac["npts"] - 1) * sac["delta"]
        if abs(sac["e"] - end) > 1.5 * sac["delta"] + 1e-5 * abs(end):
            given = f"a SAC file that says it ends at {sac['e']:g} s, and at {end:g} s by DELTA"
            raise InvalidInput(given, "the two agree", "download it again, or correct the header")


def doubts(sac: Any, samples: np.ndarray[Any, Any], channel: str) -> Iterator[str]:
    """What of a header speaks against samples that are accelerations, in words.

    Raises
    ------
    InvalidInput
        If it says that they are another quantity.
    """
    if other := _OTHER.get(int(sac.get("idep", 0))):
        rule = "without a response its samples are accelerations"
        remedy = "differentiate it, or give motion.response"
        raise InvalidInput(f"a SAC file of {other} (IDEP)", rule, remedy)
    scale = float(sac.get("scale", 1.0))
    if scale != 1.0:
        yield f"{channel}: SCALE of the header, {scale:g}, was left alone"
    mean, most = float(samples.mean()), float(np.abs(samples).max())
    peaks = [abs(float(sac[key])) for key in ("depmin", "depmax") if key in sac]
    if peaks and not is_near(max(peaks), most):
        yield f"{channel}: by DEPMIN and DEPMAX of the header a peak of {max(peaks):g}"
    if abs(float(sac.get("depmen", mean)) - mean) > _MEAN * most:
        yield f"{channel}: by DEPMEN of the header a mean of {sac['depmen']:g}"
