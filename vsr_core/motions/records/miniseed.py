"""Records of a miniSEED file: that they are whole, and begin when their samples say."""

from __future__ import annotations

import io
import re
from collections import defaultdict
from itertools import pairwise
from typing import Literal

from vsr_core.errors import InvalidInput

BEGIN = re.compile(rb"([0-9]{6}[DRQM]|[ \0]{6}[DRQM][ \0](?=.{0,56}\0))", re.DOTALL)
"""Of a record: its number, or blanks where it has none, and its quality."""

DRIFT = 1.0
"""Samples by which the records of a channel may come to begin late, or early, in small parts."""

_ORDER: dict[str, Literal["big", "little"]] = {">": "big", "<": "little"}

_BLANK = re.compile(rb"[0-9]{6}[D ] {41,}")
"""A record without data."""

_Spans = list[tuple[float, int, float]]  # start [s], number of samples, their rate [1/s]


def checked(content: bytes, read: int) -> list[str]:
    """What is odd of a file of records, in words.

    Refused are bytes that are not one record after the other, and a clock that drifts.

    ObsPy passes over such bytes and over records that it cannot decode, and puts what begins less
    than half a sample late where it would begin at the stated rate.

    Parameters
    ----------
    read : int, samples that ObsPy found

    Raises
    ------
    InvalidInput
    """
    from obspy.io.mseed import util  # type: ignore[import-not-found,import-untyped,unused-ignore]

    whole, end = io.BytesIO(content), 0
    channels = defaultdict[tuple[str, ...], _Spans](list)
    forms = defaultdict[str, set[tuple[object, ...]]](set)
    while BEGIN.match(content, end) or _BLANK.match(content, end):
        if blank := _BLANK.match(content, end):
            length = len(blank[0])
        else:
            told = util.get_record_information(whole, end)
            length = told["record_length"]
            name = tuple(told[key] for key in ("network", "station", "location", "channel"))
            channels[name].append((told["starttime"].timestamp, told["npts"], told["samp_rate"]))
            _check_rate(content[end : end + 48], _ORDER[told["byteorder"]], told["samp_rate"])
            begin = int.from_bytes(content[end + 44 : end + 46], _ORDER[told["byteorder"]])
            if told["npts"]:
                forms[".".join(name)].add((length, told.get("encoding"), begin))
        if length & (length - 1):
            break  # all are of powers of two
        end += length
    if end != len(content):
        given = f"a miniSEED file of {len(content)} bytes whose records end at byte {end}"
        raise InvalidInput(given, "it is whole records", "download it again")
    if (stated := sum(count for spans in channels.values() for _, count, _ in spans)) != read:
        given = f"records of {stated} samples, of which {read} can be read"
        raise InvalidInput(given, "it is whole", "download it again")
    for name, spans in channels.items():
        if abs(late := _drift(sorted(spans))) > DRIFT:
            given = f"records of {name[-1]} that begin {late:+.1f} samples off their rate in sum"
            rule = f"they follow each other to {DRIFT:g} sample"
            raise InvalidInput(given, rule, "resample it by the times of its records")
    return [
        f"records of {name} differ in length, encoding or begin of data: a header may be damaged"
        for name, found in forms.items()
        if len(found) > 1
    ]


def _check_rate(header: bytes, order: Literal["big", "little"], rate: float) -> None:
    """Refuse a rate that is not about that of the header, as of a blockette 100 (SEED manual 2.4).

    The header's is a factor and a multiplier, which divides where it is negative.
    """
    factor, multiplier = (
        int.from_bytes(header[at : at + 2], order, signed=True) for at in (32, 34)
    )
    if factor and multiplier:
        one, other = (float(abs(n)) ** (1 if n > 0 else -1) for n in (factor, multiplier))
        if abs(rate / (one * other) - 1.0) > RATE:
            given = f"a record of {rate:g} samples a second, whose header says {one * other:g}"
            raise InvalidInput(given, "the two agree", "download it again")


RATE = 0.02
"""Share by which the rate of a record may be off that of its header, which are whole numbers."""


def _drift(spans: _Spans) -> float:
    """Sum of what records begin late by less than half a sample, as what is more is a gap."""
    late = 0.0
    for (start, count, rate), (following, _, _) in pairwise(spans):
        off = (following - start) * rate - count
        late += off if abs(off) < 0.5 else 0.0
    return late
