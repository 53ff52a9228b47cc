"""Where the components of a record point: as their file or response says, or by their names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import Direction, Record
from vsr_core.motions.records.station import channel_of

_VERTICAL = re.compile(
    "(UP(WARDS?|DO(WN)?|DN)?|UD|DOWN|DWN|DN|VE?RTC?|VERTI[CK]ALE?|(ACC(EL(ERATION)?)?)?Z"
    "|[A-Z][GHLN]Z)[0-9]*|VER|ZACC(EL(ERATION)?)?",
    re.IGNORECASE,
)
"""Words for vertical channels: of networks' files, SEED's among them, and of columns."""

_DOWN = re.compile("(DOWN|DWN|DN)[0-9]*", re.IGNORECASE)

_ALONG_Z = re.compile("AZ[0-9]*", re.IGNORECASE)
"""Alone vertical as well, and beside other words maybe an azimuth."""

_TWO_ENDS = re.compile(
    r"(?<![^\W_])(?:(U)P?[\W_]+(D)(?:OWN|N)?|(D)(?:OWN|N)?[\W_]+(U)P?|(E)[\W_]+(W)|(N)[\W_]+(S))"
    r"(?![^\W_])",
    re.IGNORECASE,
)
"""Both ends of a direction: Up-Down, N/S."""

_UNIT = re.compile(r"\bc?m/s\S*")

_AFTER = re.compile(r"\s*[(\[]([^(\[]*)[)\]]\W*$")
"""A unit after a name, or the number of a sensor among others in its direction."""

_BETWEEN = re.compile(r"(?<=[^\W\d_])[\W_]+(?=[^\W\d_])|^[\W_]+|[\W_]+$")
"""What parts the letters of a name: N-S, U/D, Up_Down."""

_LETTERS = re.compile(r"^[^\W\d]+(?=\d)")
"""Letters before a number, which may be an azimuth."""

_WORDS = re.compile(r"\d+\.\d+|[^\W_]+")

_SIDES = {"E": 90, "EAST": 90, "N": 0, "NORTH": 0, "W": 270, "WEST": 270, "S": 180, "SOUTH": 180}

_SIDE = re.compile("(?:[A-Z]{2})?([EN])|(?=EW|NS)([EN])[WS][12]?|([WS])")
"""Names of channels to a side: SEED's, those of K-NET and KiK-net, and W and S alone."""

_SIDE_WORD = re.compile(
    "(?:[A-Z][GHLN])?([EN])|(?=EW|NS)([EN])[WS][12]?|([WS]|NORTH|EAST|SOUTH|WEST)", re.IGNORECASE
)
"""Words that may mean a side."""

_BEARING = re.compile("([NS])([0-9]{1,2})([EW])", re.IGNORECASE)

_NUMBERED = re.compile("(?:^|(?<![A-Z0-9])(?:[A-Z]{2}|H))([12])$")
"""Ends of names of two horizontal channels that say no direction: SEED's, and of COSMOS."""

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
        channel = channel_of(trace, inventory)
        known = channel.azimuth, channel.dip
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
    if _DOWN.fullmatch(_last(_words(names.get("z", "")))) or dip >= _STEEP:
        rule, remedy = "z points up", "change the sign of its samples"
        raise InvalidInput(f"{names['z']} as z, which points down", rule, remedy)
    known = _azimuths_told(told) or known
    if not _is_square(known):
        _refuse_pair(names, known)


def _name(record: Record) -> str:
    """The name of its channel; of an instrument's without the station before it."""
    name = record.channels[0]
    code = name.rpartition(".")[2]
    return code if record.instruments and code.isalnum() else name


def _is_vertical(name: str) -> bool:
    """Whether a channel is vertical by its last word.

    >>> [_is_vertical(name) for name in ("UD2", "-UP", "up (1)", "acc_z", "hnz", "U/D", "G02-UP")]
    [True, True, True, True, True, True, True]
    >>> [_is_vertical(name) for name in ("V", "x (up)", "D_N", "GBZ_180", "H1 (Az 90)")]
    [False, False, False, False, False]
    """
    words = _words(name)
    if _points(_LETTERS.sub("", _last(words))) is not None:
        return False  # AZ090
    alone = len(words) == 1 and _ALONG_Z.fullmatch(words[0])
    return bool(alone or _VERTICAL.fullmatch(_last(words)))


def _last(words: list[str]) -> str:
    return words[-1] if words else ""


def _doubtful(name: str) -> list[str]:
    """Words that may mean vertical."""
    return [one for one in _words(name) if _VERTICAL.fullmatch(one) or _ALONG_Z.fullmatch(one)]


def _plain(name: str) -> str:
    """A name without its unit and what parts its letters.

    >>> _plain("U/D [g]"), _plain("-UP"), _plain("047")
    ('UD', 'UP', '047')
    """
    return _BETWEEN.sub("", _AFTER.sub("", _UNIT.sub("", name)))


def _words(name: str) -> list[str]:
    """Those in brackets first; both ends of a direction are one.

    >>> _words("acc_up m/s2"), _words("East (Z down)"), _words("U-D (1)"), _words("ax_0.250")
    (['acc', 'up'], ['Z', 'down', 'East'], ['1', 'UD'], ['ax', '0.250'])
    """
    name = _UNIT.sub("", _TWO_ENDS.sub(_joined, name))
    inside = _AFTER.search(name)
    return _WORDS.findall(f"{inside[1] if inside else ''} {_AFTER.sub('', name)}")


def _joined(ends: re.Match[str]) -> str:
    """UD, EW or NS, whichever end comes first.

    >>> _words("Down-Up"), _words("acc e/w")
    (['UD'], ['acc', 'EW'])
    """
    both = {end.upper() for end in ends.groups() if end}
    return next(word for word in ("UD", "EW", "NS") if both == {*word})


def _told(components: Mapping[str, Record]) -> dict[str, Direction]:
    """Directions by file or response; none where all are alike, as they were not filled in."""
    found = {axis: one.directions[0] for axis, one in components.items() if one.directions}
    told = {axis: one for axis, one in found.items() if one is not None}
    return told if len(told) == 1 or len(set(told.values())) > 1 else {}


def _azimuths_told(told: Mapping[str, Direction]) -> dict[str, float]:
    """Azimuths of x and y, where they differ."""
    level = {axis: told[axis].azimuth for axis in "xy" if axis in told}
    return level if len(set(level.values())) == 2 else {}


def _is_square(known: Mapping[str, float]) -> bool:
    """Whether y points to the left of x, as far as both are known."""
    return len(known) < 2 or abs((known["x"] - known["y"]) % 360 - 90) <= _SQUARE


def _refuse_pair(names: Mapping[str, str], known: Mapping[str, float]) -> None:
    of = {
        axis: name if _azimuth(name) == known[axis] else f"{name} ({known[axis]:g} deg)"
        for axis, name in names.items()
        if axis in known
    }
    remedy = "name another channel or file"
    if abs((known["x"] - known["y"]) % 360 - 270) <= _SQUARE:
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
    names = {axis: _name(one) for axis, one in components.items()}
    up, told = names.pop("z", ""), _told(components)
    found = [
        f"{name} as {axis} is taken as horizontal, though {words[0]} may mean vertical"
        for axis, name in names.items()
        if (words := _doubtful(name))
    ]
    if up and "z" not in told:
        found += [
            f"{up} as z is taken as {taken}, though {word} may mean another direction"
            for word, taken in _against(up)
        ]
    for axis in sorted(told.keys() & names):
        azimuth, named = told[axis].azimuth, _azimuth(names[axis], numbered=True)
        if named is not None and abs((azimuth - named + 180) % 360 - 180) > _SQUARE:
            found += [f"{names[axis]} as {axis} points to {azimuth:g} deg by its file or response"]
    if not _azimuths_told(told) and len(names) == 2:
        found += _about_pair(names["x"], names["y"])
    return found


def _against(name: str) -> Iterator[tuple[str, str]]:
    """A word of a vertical channel's name that tells otherwise, and what it is taken as."""
    words = _words(name)
    if down := [word for word in words if _DOWN.fullmatch(word)]:
        yield down[0], "up"
    level = [word for word in words if _points(word) is not None or word.upper() in ("X", "Y")]
    if level and not _is_vertical(name):
        yield level[-1], "vertical"


def _about_pair(x: str, y: str) -> Iterator[str]:
    by_words = {
        axis: azimuths[-1]
        for axis, name in (("x", x), ("y", y))
        if (azimuths := [one for one in map(_points, _words(name)) if one is not None])
    }
    if not _is_square(by_words) and by_words["x"] != by_words["y"]:
        yield f"{x} as x and {y} as y are taken so, though by these words y is not to the left of x"
    numbers = [_NUMBERED.search(name) for name in (x, y)]
    if [one and one[1] for one in numbers] == ["1", "2"]:
        yield f"{y} mostly points to the right of {x}: if so, x and y are to be exchanged"


def _azimuth(channel: str, *, numbered: bool = False) -> int | None:
    """Where a channel points by its name, clockwise from north [degree]; None if that is not told.

    Parameters
    ----------
    numbered : whether a number of less than three digits is none of degrees, as of a table's column

    >>> [_azimuth(name) for name in ("047", "E [g]", "N-S", "90 (2)", "H1", "2", "DWN", "401")]
    [47, 90, 0, 90, None, None, None, None]
    """
    channel = _plain(channel)
    if channel.isdecimal() and len(channel) < len("000"):
        return None if numbered or channel in ("1", "2", "3") else int(channel)
    side = None if _is_vertical(channel) else _SIDE.fullmatch(channel)
    if side:
        return _SIDES[side[side.lastindex or 1]]
    return _points(channel) if channel.isdecimal() or len(channel) > len("HNE") else None


def _points(word: str) -> int | None:
    """The azimuth [degree] that a word may be, of three digits, a side or a bearing.

    >>> [_points(word) for word in ("047", "hne", "North", "NS1", "S69E", "401", "run", "90")]
    [47, 90, 0, 0, 111, None, None, None]
    """
    if word.isdecimal():
        return int(word) if len(word) == len("000") and int(word) <= 360 else None
    if bearing := _BEARING.fullmatch(word):
        off = int(bearing[2]) * (1 if bearing[3].upper() == "E" else -1)
        return (off if bearing[1].upper() == "N" else 180 - off) % 360
    side = _SIDE_WORD.fullmatch(word)
    return _SIDES[side[side.lastindex or 1].upper()] if side else None
