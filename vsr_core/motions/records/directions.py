"""Where the components of a record point: as their file or response says, or by their names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import Direction, Record

_VERTICAL = re.compile(
    "(UP(WARDS?|DO(WN)?|DN)?|UD|DOWN|DWN|DN|VE?RTC?|VERTI[CK]ALE?|(ACC(EL(ERATION)?)?)?Z"
    "|[A-Z][GHLN]Z)[0-9]?|VER|ZACC(EL(ERATION)?)?",
    re.IGNORECASE,
)
"""Words for vertical channels: of networks' files, SEED's among them, and of columns."""

_ALONG_Z = re.compile("AZ[0-9]?", re.IGNORECASE)
"""As well, but beside a bearing it is an azimuth."""

_BEARING = re.compile("[1-9][0-9]|[0-3][0-9]{2}|[NS][0-9]{1,2}[EW]", re.IGNORECASE)

_DOWN = re.compile("(DOWN|DWN|DN)[0-9]?", re.IGNORECASE)

_SAYS_NOTHING = re.compile(
    "A|ACC(EL(ERATION)?)?|(CH(ANNEL)?|COMP(ONENT)?)[0-9]*|0?[0-9]|00[1-4]|M?G|GALS?|[CM]?MS2",
    re.IGNORECASE,
)
"""Words of a name, numbers of sensors and units among them, that are about no direction."""

_UP_AND_DOWN = re.compile(r"(?<![^\W_])(UP|U)[-/_ ](DOWN|DN|D)(?![^\W_])", re.IGNORECASE)

_UNIT = re.compile(r"\bc?m/s\S*")

_AFTER = re.compile(r"\s*[(\[]([^(\[]*)[)\]]$")
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
    whole = {axis: _whole(one) for axis, one in components.items()}
    known: dict[str, float] = {
        axis: azimuth
        for axis, one in components.items()
        if (azimuth := _azimuth(names[axis], numbered=not one.instruments)) is not None
    }
    told = _told(components)
    for axis, name in names.items():
        steep = axis in told and abs(told[axis].dip) >= _STEEP
        if axis != "z" and (_is_vertical(whole[axis]) or steep):
            raise InvalidInput(f"{name} as {axis}, which is vertical", rule, remedy)
    dip = told["z"].dip if "z" in told else -90.0
    if "z" in known or abs(dip) < _STEEP:
        raise InvalidInput(f"{names['z']} as z", "z is the vertical component", remedy)
    if _points_down(whole.get("z", "")) or dip >= _STEEP:
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


def _whole(record: Record) -> str:
    """The same; where no instrument is known, what stands before a dot may be anything."""
    return _name(record) if record.instruments else record.channels[0]


def _is_vertical(name: str) -> bool:
    """Whether a channel is vertical by its name.

    >>> [_is_vertical(name) for name in ("UD2", "-UP", "up (1)", "acc_z", "hnz", "U/D", "G02-UP")]
    [True, True, True, True, True, True, True]
    >>> [_is_vertical(name) for name in ("V", "x (up)", "up-dip", "GBZ_180", "H1 (Az 90)")]
    [False, False, False, False, False]
    """
    word = _deciding(name)
    if _ALONG_Z.fullmatch(word):
        return not any(map(_BEARING.fullmatch, _words(name)))
    return bool(_VERTICAL.fullmatch(word))


def _points_down(name: str) -> bool:
    """Whether a vertical channel is positive downwards by its name.

    >>> [_points_down(name) for name in ("down (3)", "Z (down)", "a_down", "Up-Down", "UD")]
    [True, True, True, False, False]
    """
    return _is_vertical(name) and any(map(_DOWN.fullmatch, _words(name)))


def _deciding(name: str) -> str:
    """The word that says whether a channel is vertical: the last one, as stations come first.

    >>> [_deciding(name) for name in ("CH1_UP", "DN 090", "acc z (1)", "a (Z)", "U-D", "acc")]
    ['UP', '090', 'z', 'Z', 'UD', '']
    """
    words = [word for word in _words(name) if not _SAYS_NOTHING.fullmatch(word)]
    return words[-1] if words else ""


def _vertical_words(name: str) -> list[str]:
    """Those that may mean vertical."""
    return [word for word in _words(name) if _VERTICAL.fullmatch(word) or _ALONG_Z.fullmatch(word)]


def _plain(name: str) -> str:
    """A name without its unit and what parts its letters.

    >>> _plain("U/D [g]"), _plain("-UP"), _plain("047")
    ('UD', 'UP', '047')
    """
    return _BETWEEN.sub("", _AFTER.sub("", _UNIT.sub("", name)))


def _words(name: str) -> list[str]:
    """Those in brackets first; up and down together are one.

    >>> _words("acc_up m/s2"), _words("East (Z down)"), _words("U-D (1)")
    (['acc', 'up'], ['Z', 'down', 'East'], ['1', 'UD'])
    """
    name = _UNIT.sub("", _UP_AND_DOWN.sub("UD", name))
    inside = _AFTER.search(name)
    return re.findall(r"[^\W_]+", f"{inside[1] if inside else ''} {_AFTER.sub('', name)}")


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


def doubts(components: Mapping[str, Record]) -> list[str]:
    """What is to be told of channels that may be vertical, or point elsewhere than their names.

    By the practice of networks the second points 90 degrees to the right of the first.

    >>> import numpy as np
    >>> one = {axis: Record(np.zeros(3), 0.01, (name,), "", "", "g") for axis, name in
    ...        (("x", "HN1"), ("y", "HN2"), ("z", "GNZ 090"))}
    >>> doubts({"x": one["x"], "y": one["y"]})
    ['HN2 mostly points to the right of HN1: if so, x and y are to be exchanged']
    >>> doubts({"x": one["y"], "y": one["x"]}), doubts({"x": one["z"]})
    ([], ['GNZ 090 as x is taken as horizontal, though GNZ may mean vertical'])
    """
    horizontal = {axis: components[axis] for axis in "xy" if axis in components}
    names = {axis: _name(one) for axis, one in horizontal.items()}
    found = [
        f"{_whole(one)} as {axis} is taken as horizontal, though {words[0]} may mean vertical"
        for axis, one in horizontal.items()
        if (words := _vertical_words(_whole(one)))
    ]
    told = _told(components)
    if "z" in components and "z" not in told:
        name = _whole(components["z"])
        if (word := _deciding(name)) and not (_is_vertical(name) or word in ("U", "V")):
            found += [f"{name} as z is taken as vertical, and up, which it does not say"]
    for axis in sorted(told.keys() & names):
        azimuth, named = told[axis].azimuth, _azimuth(names[axis], numbered=True)
        if named is not None and abs((azimuth - named + 180) % 360 - 180) > _SQUARE:
            found += [f"{names[axis]} as {axis} points to {azimuth:g} deg by its file or response"]
    numbers = [_NUMBERED.fullmatch(name) for name in names.values()]
    if not _azimuths_told(told) and [one and one[1] for one in numbers] == ["1", "2"]:
        one, two = names.values()
        found += [f"{two} mostly points to the right of {one}: if so, x and y are to be exchanged"]
    return found


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
        digits = len(channel)
        told = digits == len("000") or (digits < len("000") and not numbered)
        return int(channel) if told and int(channel) <= 360 else None
    side = None if _is_vertical(channel) else _SIDE.fullmatch(channel)
    return {"E": 90, "N": 0, "W": 270, "S": 180}[side[side.lastindex or 1]] if side else None
