"""Where the components of a record point: as their file or response says, or by their names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import Direction, Record

_VERTICAL = re.compile(
    "UP(DO(WN)?|DN|WARDS?)|ZACC|(UP|VE?RTC?|VERTI[CK]ALE?|UD|(ACC(EL(ERATION)?)?)?Z)[0-9]?",
    re.IGNORECASE,
)
"""Names of vertical channels: of networks' files, and of columns."""

_OF_CHANNEL = re.compile("VER|(DOWN|DN|DWN|[A-HLMO-VX][GHLN]Z)[0-9]?", re.IGNORECASE)
"""More of them, SEED's among them, which beside an azimuth are a station's, or a hole's."""

_UP, _DOWN, _AZ = (
    re.compile(f"({words})[0-9]?", re.IGNORECASE) for words in ("UP", "DOWN|DN|DWN", "AZ")
)

_LEVEL = re.compile(
    "[XYNESWRT]|NS|EW|NORTH|SOUTH|EAST|WEST|ALONG|ACROSS|RADIAL|TRANSVERSE|LONGITUDINAL|LATERAL"
    "|DIP|STRIKE|FAULT|SLOPE|HILL|STREAM|RIVER|VALLEY|CANYON",
    re.IGNORECASE,
)
"""Words of a horizontal direction, beside which up and down are a way along it."""

_AZIMUTH = re.compile(
    "000|0(0[5-9]|[1-9][0-9])|[12][0-9]{2}|3([0-5][0-9]|60)|90|[NS][0-9]{1,2}[EW]"
    "|[A-HLMO-VX][GHLN][ENRTXY12]",
    re.IGNORECASE,
)
"""And horizontal channels of SEED's: beside these, names of `_OF_CHANNEL` are a station's."""

_UNIT = re.compile(r"\bc?m/s\S*")

_AFTER = re.compile(r"\s*[(\[][^(\[]*[)\]]$")
"""A unit after a name, or the number of a sensor among others in its direction."""

_BETWEEN = re.compile(r"(?<=[^\W\d_])[-/_ ](?=[^\W\d_])|^[-_ ]+|[-_ ]+$")
"""What parts the letters of a name: N-S, U/D, Up_Down."""

_SIDE = re.compile("(?:[A-Z]{2})?([EN])|(?=EW|NS)([EN])[WS][12]?|([WS])")
"""Names of channels to a side: SEED's, those of K-NET and KiK-net, and W and S alone."""

_NUMBERED = re.compile("(?:[A-Z]{2}|H)?([12])")
"""Names of two horizontal channels which do not say where they point: SEED's, and of COSMOS."""

_SQUARE = 5
"""Within which directions are at right angles, as SEED has it of N and E [degree]."""

_STEEP = 45
"""Dip [degree] from which on a channel is vertical."""


def of_stream(stream: Any, inventory: Any | None) -> tuple[Direction | None, ...]:
    """Where the traces of an ObsPy stream point by StationXML or, of SAC, by CMPAZ and CMPINC.

    None where nothing is told.
    """
    return tuple(_of_trace(trace, inventory) for trace in stream)


def _of_trace(trace: Any, inventory: Any | None) -> Direction | None:
    if inventory is not None:
        told = inventory.get_orientation(trace.id, trace.stats.starttime)
        known = told["azimuth"], told["dip"]
        return None if None in known else Direction(*map(float, known))
    sac = trace.stats.get("sac", {})
    if not {"cmpaz", "cmpinc"} <= sac.keys():
        return None
    azimuth, inclined = float(sac["cmpaz"]), float(sac["cmpinc"])
    if not azimuth and not inclined:
        return None  # up, or not filled in
    # from up, but in files of those who write a dip: no vertical has an azimuth
    return Direction(azimuth, inclined - 90.0 if inclined > 0.0 else inclined)


def check_directions(components: Mapping[str, Record]) -> None:
    """Refuse components of which x and y are not horizontal, with y to the left, or z not up."""
    rule, remedy = "x and y are horizontal", "leave it out, or name another channel or file"
    names = {axis: _name(one) for axis, one in components.items()}
    known: dict[str, float] = {
        axis: azimuth
        for axis, one in components.items()
        if (azimuth := _azimuth(names[axis], numbered=not one.instruments)) is not None
    }
    told = _told(components)
    for axis, name in names.items():
        steep = axis in told and abs(told[axis].dip) >= _STEEP
        if axis != "z" and (_is_vertical(name) or steep):
            raise InvalidInput(f"{name} as {axis}, which is vertical", rule, remedy)
    dip = told["z"].dip if "z" in told else -90.0
    if "z" in known or abs(dip) < _STEEP:
        raise InvalidInput(f"{names['z']} as z", "z is the vertical component", remedy)
    if _points_down(names.get("z", "")) or dip >= _STEEP:
        rule, remedy = "z points up", "change the sign of its samples"
        raise InvalidInput(f"{names['z']} as z, which points down", rule, remedy)
    known = _azimuths_told(told) or known
    if len(known) == 2:
        _check_square(names, known)


def _name(record: Record) -> str:
    """The name of its channel, without the station's before it."""
    name = record.channels[0]
    code = name.rpartition(".")[2]
    return code if code.isalnum() else name


def _is_vertical(name: str) -> bool:
    """Whether a channel is vertical by its name.

    >>> [_is_vertical(name) for name in ("UD2", "-UP", "up (1)", "acc_z", "hnz", "U/D", "G02-UP")]
    [True, True, True, True, True, True, True]
    >>> [_is_vertical(name) for name in ("V", "x (up)", "up-dip", "GBZ_180", "H1 (Az 90)")]
    [False, False, False, False, False]
    """
    whole, words = _plain(name), _words(name)
    if _VERTICAL.fullmatch(whole) or _OF_CHANNEL.fullmatch(whole):
        return True
    if any(map(_LEVEL.fullmatch, words)):
        return False
    known = [_VERTICAL]
    if not any(map(_AZIMUTH.fullmatch, words)):
        known += [_OF_CHANNEL]
        if not any(len(word) > 1 and word.isdecimal() for word in words):
            known += [_AZ]  # the acceleration along z, and no azimuth
    return any(one.fullmatch(word) for one in known for word in words)


def _points_down(name: str) -> bool:
    """Whether a vertical channel is positive downwards by its name.

    >>> [_points_down(name) for name in ("down (3)", "DWN (ERD)", "a_down", "Up-Down", "UD")]
    [True, True, True, False, False]
    """
    words = _words(name)
    return any(map(_DOWN.fullmatch, words)) and not any(map(_UP.fullmatch, words))


def _plain(name: str) -> str:
    """A name without its unit and what parts its letters.

    >>> _plain("U/D [g]"), _plain("-UP"), _plain("047")
    ('UD', 'UP', '047')
    """
    return _BETWEEN.sub("", _AFTER.sub("", _UNIT.sub("", name)))


def _words(name: str) -> list[str]:
    return re.findall(r"[^\W_]+", _UNIT.sub("", name))


def _told(components: Mapping[str, Record]) -> dict[str, Direction]:
    """Directions by file or response; none where all are alike, as they were not filled in."""
    found = {axis: one.directions[0] for axis, one in components.items() if one.directions}
    told = {axis: one for axis, one in found.items() if one is not None}
    return told if len(told) == 1 or len(set(told.values())) > 1 else {}


def _azimuths_told(told: Mapping[str, Direction]) -> dict[str, float]:
    """Azimuths of x and y, where they differ."""
    level = {axis: told[axis].azimuth for axis in "xy" if axis in told}
    return level if len(set(level.values())) == 2 else {}


def _check_square(names: Mapping[str, str], known: Mapping[str, float]) -> None:
    to_the_left = (known["x"] - known["y"]) % 360
    if abs(to_the_left - 90) > _SQUARE:
        of = {
            axis: name if _azimuth(name) == known[axis] else f"{name} ({known[axis]:g} deg)"
            for axis, name in names.items()
            if axis in known
        }
        remedy = "name another channel or file"
        if abs(to_the_left - 270) <= _SQUARE:
            remedy = "exchange x and y"
        rule = "y points 90 degrees to the left of x"
        raise InvalidInput(f"{of['x']} as x and {of['y']} as y", rule, remedy)


def doubt(components: Mapping[str, Record]) -> str:
    """What is to be told of channels that point elsewhere than their names, or anywhere.

    By the practice of networks the second points 90 degrees to the right of the first.

    >>> import numpy as np
    >>> one = {axis: Record(np.zeros(3), 0.01, (f"HN{n}",), "", "", "g") for axis, n in
    ...        (("x", 1), ("y", 2))}
    >>> doubt(one), doubt({"x": one["y"], "y": one["x"]})
    ('HN2 mostly points to the right of HN1: if so, x and y are to be exchanged', '')
    """
    told = _told(components)
    for axis in sorted(told.keys() & {"x", "y"}):
        name, azimuth = _name(components[axis]), told[axis].azimuth
        named = _azimuth(name, numbered=True)
        if named is not None and abs((azimuth - named + 180) % 360 - 180) > _SQUARE:
            return f"{name} as {axis} points to {azimuth:g} deg by its file or response"
    horizontal = [components[axis] for axis in "xy" if axis in components]
    names = [_name(one) for one in horizontal]
    found = [_NUMBERED.fullmatch(name) for name in names]
    if _azimuths_told(told) or [one[1] if one else "" for one in found] != ["1", "2"]:
        return ""
    return (
        f"{names[1]} mostly points to the right of {names[0]}: if so, x and y are to be exchanged"
    )


def _azimuth(channel: str, *, numbered: bool = False) -> int | None:
    """Where a channel points by its name, clockwise from north [degree]; None if that is not told.

    Parameters
    ----------
    numbered : whether a number of less than three digits is none of degrees, as of a table's column

    >>> [_azimuth(name) for name in ("047", "E [g]", "N-S", "90 (2)", "H1", "2", "DWN", "401")]
    [47, 90, 0, 90, None, None, None, None]
    """
    channel = _plain(channel)
    if channel in ("1", "2", "3"):
        return None
    if channel.isdecimal():
        told = len(channel) == len("000") or not numbered
        return int(channel) if told and int(channel) <= 360 else None
    side = None if _is_vertical(channel) else _SIDE.fullmatch(channel)
    return {"E": 90, "N": 0, "W": 270, "S": 180}[side[side.lastindex or 1]] if side else None
