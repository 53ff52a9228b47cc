"""Which format a file is in, by its content, and its record; miniSEED, SAC and K-NET by ObsPy."""

from __future__ import annotations

import codecs
import io
import math
import re
import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vsr_core.errors import InvalidInput, reason
from vsr_core.motions.named_columns import refuse_cut_lines
from vsr_core.motions.records import columns, miniseed, sac_files, text_files
from vsr_core.motions.records.directions import of_stream
from vsr_core.motions.records.instrument_response import (
    Corners,
    check_stated_once,
    without_response,
)
from vsr_core.motions.records.record import (
    Record,
    check_sampling,
    factor,
    is_near,
    side_by_side,
    stated,
)

MOST_WARNINGS, WARNING_LENGTH = 3, 160
"""Warnings of ObsPy that are kept, and characters of each."""


def read_waveforms(
    content: bytes, kind: str, unit: str | None, response: bytes | None, corners: Corners | None
) -> Record:
    """The record in a file's content, its channels cut to the time that all have.

    What ObsPy warns of is among the record's repairs.

    Parameters
    ----------
    kind : str, ObsPy's name of the format
    unit : str or None, for formats that do not state one
    response : bytes or None, StationXML; with it the response is removed, to acceleration
    corners : tuple of float [Hz], of the cosine taper of the spectrum before that

    Raises
    ------
    InvalidInput
        If ObsPy cannot read it, the response does not fit, or the unit is not known.
    """
    import obspy  # type: ignore[import-not-found,import-untyped,unused-ignore]

    odd, doubts, inventory = list[str](), list[str](), None
    rate = _checked_rate_of_knet(content) if kind == "KNET" else None
    content = sac_files.of_version_6(content) if kind == "SAC" else content
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            # By name: left to find out, ObsPy tries Python's pickles too, which run what they hold.
            stream = obspy.read(io.BytesIO(content), format=kind)
            if any("integrity check" in str(warned.message) for warned in caught):
                given = "samples that contradict the last one, which the file states, too"
                raise InvalidInput(given, "it is whole", "download it again")
            if rate is not None:
                stream[0].stats.sampling_rate = rate  # of which ObsPy takes the whole part
            if kind == "MSEED":
                odd = miniseed.checked(content, sum(len(trace) for trace in stream))
                stream.traces = [trace for trace in stream if len(trace)]
            if kind == "SACXY":
                if not content.endswith(b"\n"):
                    given = "a SAC file of text whose last line has no end"
                    raise InvalidInput(given, "it is whole", "download it again, or end the line")
                refuse_cut_lines(content.decode("latin-1").splitlines()[_SACXY_HEADER:])
            _check_span(stream)
            _check_quantity(stream)
            if response is not None:
                check_stated_once(response)
                inventory = obspy.read_inventory(io.BytesIO(response), format="STATIONXML")
                stream, doubts = without_response(stream, inventory, corners)
            else:
                doubts = _check_is_acceleration(stream)
            stream.merge()
        record = from_stream(stream, "m/s2" if response is not None else unit)
        directions = of_stream(stream, inventory)
    except InvalidInput:
        raise
    except Exception as error:  # noqa: BLE001 (readers of many formats raise what they like)
        raise _unreadable(error) from None
    repairs = (*record.repairs, *odd, *doubts, *_warnings(caught))
    return replace(record, repairs=repairs, directions=directions)


_WEAK = 1.0
"""Peak [gal] up to which K-NET's header may round it to 0."""

_PRESSURE = re.compile("[A-Z]D[DFGHIOU]")
"""Channels of pressure by SEED's codes."""

_SEISMOMETERS = "HLP"
"""Instrument codes of SEED (manual 2.4, appendix A) whose samples follow velocity."""


_SACXY_HEADER = 30
"""Lines before the samples of a SAC file of text."""


def _check_quantity(stream: Any) -> None:
    """Refuse what is no time series of a motion, or contradicts its header."""
    rule, remedy = "it is a motion in even steps of time", "use the record of the acceleration"
    for trace in stream:
        channel = str(trace.stats.channel)
        sac_files.check_series(trace.stats.get("sac", {}))
        if _PRESSURE.fullmatch(channel):
            raise InvalidInput(f"{channel}, by its code a pressure", rule, remedy)
        if (said := trace.stats.get("knet", {}).get("accmax")) is not None:
            moved = float(np.abs(trace.data - trace.data.mean()).max())
            peak = moved * trace.stats.calib / factor("gal")
            if not is_near(said, peak) and (said or peak > _WEAK):
                given = f"a peak of {peak:.4g} gal by its scale factor, where it says {said:g} gal"
                raise InvalidInput(given, "the two agree", "download it again")


def _check_is_acceleration(stream: Any) -> list[str]:
    """Refuse traces that say they hold another quantity; what else speaks against it is told."""
    doubts = list[str]()
    for trace in stream:
        channel = str(trace.stats.channel)
        doubts += sac_files.doubts(trace.stats.get("sac", {}), trace.data, channel)
        if len(channel) == 3 and channel[1] in _SEISMOMETERS:
            doubts.append(f"{channel}: by its code a seismometer; taken as accelerations")
    return doubts


_KNET_HEADER = 17
"""Lines of the header of K-NET and KiK-net."""

_KNET_SIZE = re.compile(
    r"^(Sampling Freq\(Hz\)|Duration Time\(s\))\s+([0-9]+\.?[0-9]*)", re.MULTILINE
)


_KNET_SAMPLE = re.compile("[+-]?[0-9]+")


def _checked_rate_of_knet(content: bytes) -> float:
    """Samples per second [Hz] by the header of a K-NET file, if it is whole.

    Refuses a file with other samples than its header says, or a last one that is cut.
    """
    lines = content.decode("latin-1").splitlines()
    said = dict(_KNET_SIZE.findall("\n".join(lines[:_KNET_HEADER])))
    samples = [line.rstrip() for line in lines[_KNET_HEADER:]]
    words = (word for line in samples for word in line.split(" ") if word)
    if odd := next((word for word in words if not _KNET_SAMPLE.fullmatch(word)), None):
        given = f"a K-NET file with {odd[:40]!r} among its samples"
        raise InvalidInput(given, "they are whole numbers", "download it again")
    number = sum(len(line.split()) for line in samples)
    rate = float(said.get("Sampling Freq(Hz)", "nan"))
    wanted = float(said.get("Duration Time(s)", "nan")) * rate
    if not (number and math.isclose(number, wanted)):
        given = f"a K-NET file of {number} samples that says {wanted:g}"
        raise InvalidInput(given, "it holds some, as many as it says", "download it again")
    refuse_cut_lines([line for line in samples if line])
    return rate


def from_stream(stream: Any, unit: str | None) -> Record:
    """The record of an ObsPy stream whose traces are merged, one for each channel.

    K-NET and KiK-net samples come as counts with a factor to m/s^2 (``stats.calib``).

    Parameters
    ----------
    unit : str or None
        Of the samples, unless they are K-NET's or KiK-net's.

    Raises
    ------
    InvalidInput
        If the channels have no time step or no time in common, or the unit is not known.
    """
    if len({trace.stats.delta for trace in stream}) != 1:
        raise InvalidInput(
            "channels of several time steps", "they share one", "keep one in the file"
        )
    start = max(trace.stats.starttime for trace in stream)
    end = min(trace.stats.endtime for trace in stream)
    interval = float(stream[0].stats.delta)
    number = round((end - start) / interval) + 1
    if number < 1:
        raise InvalidInput(
            "channels at different times", "they have some in common", "keep one of them"
        )
    japanese = all("knet" in trace.stats for trace in stream)
    name = stated("gal" if japanese else None, unit)
    columns, repairs, cut = [], [], 0
    for trace in stream:
        first = round((start - trace.stats.starttime) / interval)
        samples = np.ma.filled(np.ma.asarray(trace.data).astype(np.float64), np.nan)
        part = samples[first : first + number]
        if len(part) < len(samples):
            lost = len(samples) - len(part)
            cut += lost
            repairs.append(f"{trace.stats.channel}: {lost} samples that others lack were cut")
        columns.append(part * (trace.stats.calib if japanese else factor(name)))
    ids = [".".join((t.stats.network, t.stats.station, t.stats.location)) for t in stream]
    channels = [str(trace.stats.channel) for trace in stream]
    instruments = tuple(map(_instrument, ids, channels))
    if len(set(channels)) < len(channels):
        channels = [f"{one}.{channel}" for one, channel in zip(ids, channels, strict=True)]
    return Record(
        side_by_side(columns),
        interval,
        tuple(channels),
        str(stream[0].stats.station),
        f"{getattr(stream[0].stats, '_format', 'waveforms')} of {ids[0]} from {start}",
        "gal by its scale factor" if japanese else name,
        tuple(repairs),
        float(start),
        cut,
        instruments,
    )


def _instrument(place: str, channel: str) -> str:
    """What recorded a channel: by band and instrument of SEED's code, or by KiK-net's depth.

    >>> _instrument("XX.NWC.", "HNE"), _instrument("BO.IWT.", "EW2"), _instrument("XX.NWC.", "E")
    ('XX.NWC..HN', 'BO.IWT..2', 'XX.NWC..')
    """
    if channel[:2] in ("EW", "NS", "UD"):
        return f"{place}.{channel[2:]}"
    return f"{place}.{channel[:2] if len(channel) == len('HNE') else ''}"


def _check_span(stream: Any) -> None:
    """Refuse traces whose gaps would be filled with more samples than a record has."""
    start = min(trace.stats.starttime for trace in stream)
    end = max(trace.stats.endtime for trace in stream)
    for trace in stream:
        check_sampling(float(trace.stats.delta), (end - start) / (trace.stats.delta or 1.0))


def _warnings(caught: list[warnings.WarningMessage]) -> list[str]:
    """What ObsPy warned of about a file, e.g. blocks that it passed over."""
    said = [" ".join(str(w.message).split()) for w in caught if issubclass(w.category, UserWarning)]
    said = [f"ObsPy: {text[:WARNING_LENGTH]}" for text in dict.fromkeys(said)]
    more = len(said) - MOST_WARNINGS
    return said[:MOST_WARNINGS] + ([f"ObsPy: {more} more warnings"] if more > 0 else [])


def _unreadable(error: Exception) -> InvalidInput:
    said = reason(error).partition(" for file ")[0]  # a temporary one of ObsPy's
    given = f"a record that ObsPy cannot read ({said[:120]})"
    rule = "it is miniSEED, SAC, K-NET or KiK-net, and a response is StationXML of its channels"
    return InvalidInput(given, rule, "download it again, or convert it")


COMPONENTS = (".ew", ".ns", ".ud", ".ew1", ".ns1", ".ud1", ".ew2", ".ns2", ".ud2")
"""Endings by which the files of one record of K-NET and KiK-net differ."""

SUFFIXES = (
    *(".at2", ".v2", ".cosmos", ".csv", ".txt", ".nc", ".mseed", ".miniseed", ".sac", ".knet"),
    *COMPONENTS,
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
    corners: Corners | None = None


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
    return read_all(content, suffix, how).channel(how.component)


def read_all(content: bytes, suffix: str, how: Reading) -> Record:
    """The record of all channels in a file's content; parameters and refusals as of ``read``.

    Only miniSEED and SAC name the channel that a response is of; in other files it is left alone,
    which is told among the repairs.
    """
    suffix = suffix.lower()
    kind = None if content.startswith(columns.MAGIC) else _waveform(content, suffix)
    if kind not in (None, "KNET"):
        return read_waveforms(content, kind, how.unit, how.response, how.corners)
    record = _of_accelerations(content, suffix, kind, how)
    if how.response is None:
        return record
    told = "motion.response left alone, which is for miniSEED and SAC"
    return replace(record, repairs=(*record.repairs, told))


def _of_accelerations(content: bytes, suffix: str, kind: str | None, how: Reading) -> Record:
    """The record in a file of accelerations."""
    if kind is not None:
        return read_waveforms(content, kind, how.unit, None, None)
    if content.startswith(columns.MAGIC):
        return columns.read_netcdf(content, how.component, how.unit)
    if b"\0" in content[:512]:
        raise _unknown()
    text = _text(content)
    start = text[: text_files.HEAD]
    if text_files.is_at2(start):
        return text_files.read_at2(text, how.unit)
    if text_files.is_cosmos(start):
        return text_files.read_cosmos(text, how.unit)
    if suffix in (".csv", ".txt"):
        return columns.read_table(text, how.component, how.unit)
    raise _unknown()


_BREAKS = dict.fromkeys(map(ord, "\v\f\x1c\x1d\x1e\x85\u2028\u2029"), " ")
"""Characters that Python takes for ends of lines, and files do not."""


def _text(content: bytes) -> str:
    content = content.removeprefix(codecs.BOM_UTF8)
    content = content.replace(b"\r\r\n", b"\n")  # an end of line made one for Windows, twice
    try:
        return content.decode("utf-8").translate(_BREAKS)
    except UnicodeDecodeError:
        return content.decode("latin-1").translate(_BREAKS)


def _waveform(content: bytes, suffix: str) -> str | None:
    """ObsPy's name of the format of a file that it reads."""
    if miniseed.BEGIN.match(content):
        return "MSEED"
    if content.startswith(b"Origin Time"):
        return "KNET"
    if suffix == ".sac":
        return "SAC" if b"\0" in content[:1024] else "SACXY"
    return None


def _unknown() -> InvalidInput:
    rule = "it is AT2, COSMOS V2, CSV, NetCDF, miniSEED, SAC, K-NET or KiK-net"
    remedy = "convert it to a CSV with columns time and acceleration [m/s2]"
    return InvalidInput("a file in no known format", rule, remedy)
