"""Records of a miniSEED file: that they are whole, and begin when their samples say."""

from __future__ import annotations

import io
import re
from collections import defaultdict
from itertools import pairwise

from vsr_core.errors import InvalidInput

BEGIN = re.compile(rb"([0-9]{6}[DRQM]|[ \0]{6}[DRQM][ \0](?=.{0,56}\0))", re.DOTALL)
"""Of a record: its number, or blanks where it has none, and its quality."""

DRIFT = 1.0
"""Samples by which the records of a channel may come to begin late, or early, in small parts."""

_BLANK = re.compile(rb"[0-9]{6}D {41,}")

_Spans = list[tuple[float, int, float]]  # start [s], number of samples, their rate [1/s]


def check(content: bytes) -> None:
    """Refuse bytes that are not one record after the other, and a clock that drifts.

    ObsPy passes over such bytes, and puts what begins less than half a sample late where it would
    begin at the stated rate.

    Raises
    ------
    InvalidInput
    """
    from obspy.io.mseed import util  # type: ignore[import-not-found,import-untyped,unused-ignore]

    whole, end = io.BytesIO(content), 0
    channels = defaultdict[tuple[str, ...], _Spans](list)
    while end < len(content) and BEGIN.match(content, end):
        blank = _BLANK.match(content, end)  # a record without data
        if blank:
            length = len(blank[0])
        else:
            told = util.get_record_information(whole, end)
            length = told["record_length"]
            name = tuple(told[key] for key in ("network", "station", "location", "channel"))
            channels[name].append((told["starttime"].timestamp, told["npts"], told["samp_rate"]))
        if length & (length - 1):
            break  # all are of powers of two
        end += length
    if end != len(content):
        given = f"a miniSEED file of {len(content)} bytes whose records end at byte {end}"
        raise InvalidInput(given, "it is whole records", "download it again")
    for name, spans in channels.items():
        if abs(late := _drift(sorted(spans))) > DRIFT:
            given = f"records of {name[-1]} that begin {late:+.1f} samples off their rate in sum"
            rule = f"they follow each other to {DRIFT:g} sample"
            raise InvalidInput(given, rule, "resample it by the times of its records")


def _drift(spans: _Spans) -> float:
    """Sum of what records begin late by less than half a sample, as what is more is a gap."""
    late = 0.0
    for (start, count, rate), (following, _, _) in pairwise(spans):
        off = (following - start) * rate - count
        late += off if abs(off) < 0.5 else 0.0
    return late
