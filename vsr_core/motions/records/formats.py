"""Which format a file is in, by its content, and its record."""

from __future__ import annotations

from dataclasses import dataclass

from vsr_core.errors import InvalidInput
from vsr_core.motions.records import at2, columns, cosmos, netcdf, waveforms
from vsr_core.motions.records.record import Record

SUFFIXES = (
    *(".at2", ".v2", ".cosmos", ".csv", ".txt", ".nc", ".mseed", ".miniseed", ".sac", ".knet"),
    *(".ew", ".ns", ".ud", ".ew1", ".ns1", ".ud1", ".ew2", ".ns2", ".ud2"),
)
"""Of the files that are taken from a folder of records."""


@dataclass(frozen=True)
class Reading:
    """What a file does not say about itself.

    Attributes
    ----------
    corners : tuple of four float or None [Hz], for the removal of the response
    """

    component: str | None = None
    unit: str | None = None
    response: bytes | None = None
    corners: waveforms.Corners | None = None


def read(content: bytes, suffix: str, how: Reading) -> Record:
    """The record of one channel in a file's content.

    Parameters
    ----------
    suffix : str
        Of the file's name; only SAC and plain tables are recognised by it.

    Raises
    ------
    InvalidInput
        If it is in no known format, breaks its format, or has no such channel.
    """
    return _whole(content, suffix.lower(), how).channel(how.component)


def _whole(content: bytes, suffix: str, how: Reading) -> Record:
    if content.startswith(netcdf.MAGIC):
        return netcdf.read(content, how.component, how.unit)
    kind = _waveform(content, suffix)
    if kind is not None:
        return waveforms.read(content, kind, how.unit, how.response, how.corners)
    if b"\0" in content[:512]:
        raise _unknown()
    text = content.decode("latin-1")
    start = text[:2000]
    if at2.is_one(start):
        return at2.read(text, how.unit)
    if cosmos.is_one(start):
        return cosmos.read(text, how.unit)
    if suffix in (".csv", ".txt"):
        return columns.read(text, how.component, how.unit)
    raise _unknown()


def _waveform(content: bytes, suffix: str) -> str | None:
    """ObsPy's name of the format of a file that it reads."""
    if content[:6].isdigit() and content[6:7] in (b"D", b"R", b"Q", b"M"):
        return "MSEED"
    if content.startswith(b"Origin Time"):
        return "KNET"
    if suffix == ".sac":
        return "SAC" if b"\0" in content[:1024] else "SACXY"
    return None


def _unknown() -> InvalidInput:
    return InvalidInput(
        "a file in no known format",
        "it is AT2, COSMOS V2, CSV, NetCDF, miniSEED, SAC, K-NET or KiK-net",
        "convert it to a CSV with columns time and acceleration [m/s2]",
    )
