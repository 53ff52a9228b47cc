"""PEER NGA acceleration files (.AT2): four lines of header, then samples in g.

The fourth line gives the number of samples and the time step, in one of two ways:
``NPTS=   7812, DT=   .0050 SEC`` or ``7812    0.0050    NPTS, DT``.
"""

from __future__ import annotations

import re

import numpy as np

from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import Record, check_sampling, factor, stated

_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?)"
_NAMED = re.compile(rf"NPTS\s*=\s*(\d+)\s*,?\s*DT\s*=\s*{_NUMBER}", re.IGNORECASE)
_PLAIN = re.compile(rf"^\s*(\d+)\s+{_NUMBER}\s+NPTS\s*,\s*DT", re.IGNORECASE)
_UNIT = re.compile(r"IN UNITS OF\s+(\S+)", re.IGNORECASE)
HEADER = 4


def is_one(start: str) -> bool:
    r"""Whether a text is such a file.

    Examples
    --------
    >>> is_one("PEER\nevent\nACCELERATION\nNPTS=  100, DT= .0050 SEC")
    True
    """
    lines = start.splitlines()
    return len(lines) >= HEADER and bool(_NAMED.search(lines[3]) or _PLAIN.search(lines[3]))


def read(text: str, unit: str | None) -> Record:
    """The record in a file's text.

    Parameters
    ----------
    unit : str or None
        Checked against the file's own.

    Raises
    ------
    InvalidInput
        If the file is no acceleration, or holds another number of samples than it says.
    """
    lines = text.splitlines()
    found = _NAMED.search(lines[3]) or _PLAIN.search(lines[3])
    quantity = lines[2].strip()
    if found is None or not quantity.upper().startswith("ACCELERATION"):
        raise InvalidInput(
            f"an AT2 file whose third line is {quantity[:40]!r}",
            "it says ACCELERATION TIME SERIES IN UNITS OF G",
            "use the acceleration (.AT2), not velocity or displacement",
        )
    number, interval = float(found[1]), float(found[2].upper().replace("D", "E"))
    check_sampling(interval, number)
    in_file = _UNIT.search(quantity)
    name = stated(in_file[1].rstrip(".") if in_file else None, unit)
    words = " ".join(lines[HEADER:]).split()
    try:
        values = np.array([float(word) for word in words])
    except ValueError as error:
        raise InvalidInput(
            f"an AT2 file with a word among its samples ({error})",
            "they are numbers",
            "download it again",
        ) from None
    if len(values) != number:
        raise InvalidInput(
            f"an AT2 file of {len(values)} samples that says NPTS = {number:.0f}",
            "it holds as many as it says",
            "download it again",
        )
    event = [part.strip() for part in lines[1].split(",")]
    station = event[-2] if len(event) > 2 else ""
    channel = event[-1] if len(event) > 1 else "1"
    source = f"PEER NGA file: {lines[1].strip()}"
    return Record(values * factor(name), interval, (channel,), station, source, name)
