"""The response of an instrument, divided out of what it recorded."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from scipy.interpolate import CubicSpline

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions import order
from vsr_core.motions.records.record import check_samples
from vsr_core.motions.records.station import channel_of

Corners = tuple[float, float, float, float]

_ALIKE = 3.0
"""Factor within which a sensitivity is that of its stages, and poles and zeros are 1."""


def without_response(stream: Any, inventory: Any, corners: Corners | None) -> tuple[Any, list[str]]:
    """An ObsPy stream of accelerations [m/s^2], its gaps masked; what is odd of it, in words.

    Parameters
    ----------
    inventory : ObsPy's, of the channels
    corners : tuple of float [Hz], of the cosine taper of the spectrum

    Raises
    ------
    InvalidInput
        Without corners or with ones out of reach, or for a response of no motion, or one that
        contradicts itself or changes.
    """
    if corners is None:
        given = "a response without corners"
        rule = "dividing by it needs a band, or it makes noise of the ends of the spectrum"
        raise InvalidInput(given, rule, "give motion.response.corners, four frequencies [Hz]")
    doubts: list[str] = []
    stream.merge()
    for trace in stream:
        trace.stats.response = channel_of(trace, inventory).response
        _check_response(trace.stats.response)
        doubts += dict.fromkeys(_doubts(trace.stats.response, trace.id))
        counts = np.ma.masked_invalid(np.ma.asarray(trace.data).astype(np.float64))
        missing, places = np.ma.getmaskarray(counts), np.arange(len(counts))
        there = places[~missing]  # a line between velocities would have jumps of acceleration
        within = np.clip(places, there[0], there[-1])
        whole = CubicSpline(there, counts.data[~missing])(within) if missing.any() else counts.data
        doubts += order.doubts(whole, trace.id)
        if np.ptp(whole):  # the taper makes a smooth pulse of what is no sample
            check_samples(whole, f"counts of {trace.stats.channel}", trace.stats.delta)
        line = np.polyval(np.polyfit(places, whole, 1), places)
        ends = min(max(math.ceil(2.0 / corners[2] / trace.stats.delta), 4), len(whole))
        trace.data = _with_ends(whole - line, ends)
        trace.remove_response(output="ACC", water_level=None, pre_filt=corners, taper=False)
        if not np.isfinite(trace.data).all():
            given = f"a response for {trace.id} that is zero, or no number, at a frequency"
            rule = "the spectrum of the record is divided by it, beyond the corners, too"
            raise InvalidInput(given, rule, "correct the response, or download it again")
        _check_upper_corners(trace, corners)
        trace.data = np.ma.masked_array(trace.data[ends : ends + len(whole)], missing)
    return stream, doubts


def check_stated_once(response: bytes) -> None:
    """Refuse a StationXML file of which a part of a response stands there twice.

    Its parts are those of "FDSN StationXML Schema 1.2" (2022).

    Raises
    ------
    InvalidInput
    """
    tree = ElementTree.fromstring(response)  # noqa: S314 (expat refuses texts that multiply)
    for whole in tree.iter():
        parts = defaultdict[str, list[Element]](list)
        for part in whole:
            parts[_name(part)].append(part)
        several = _SEVERAL if (name := _name(whole)) != "Channel" else parts.keys() - {"Response"}
        for kind, found in parts.items() if name in _PARTS else ():
            if kind not in several and len(found) > 1:
                given = f"a StationXML file with {len(found)} {kind} in a {name}"
                raise InvalidInput(given, "there is one", "correct it, or download it again")
            numbers = [int(one.get("number", one.get("i", -1))) for one in found]
            if (
                kind in _SEVERAL
                and min(numbers) >= 0
                and sorted(numbers) != list(range(min(numbers), min(numbers) + len(numbers)))
            ):
                given = f"a StationXML file with {kind} in a {name} of which some are not counted"
                raise InvalidInput(given, "their numbers follow each other", "download it again")


def _name(part: Element) -> str:
    return part.tag.rpartition("}")[2]


_PARTS = {"Channel", "Response", "InstrumentSensitivity", "Stage", "StageGain", "PolesZeros",
          "Coefficients", "FIR", "Decimation", "InputUnits", "OutputUnits"}  # fmt: skip
_SEVERAL = {"Stage", "Pole", "Zero", "Numerator", "Denominator", "NumeratorCoefficient"}


def _doubts(response: Any, name: str) -> Iterator[str]:
    """Poles, zeros, coefficients and signs that no instrument has, in words."""
    whole = getattr(response.instrument_sensitivity, "value", None) or 1.0
    gains = math.prod(stage.stage_gain or 1.0 for stage in response.response_stages)
    if whole * gains < 0.0:
        yield f"gains of {name} have another sign than its sensitivity: it may be turned round"
    for stage in response.response_stages:
        if _OFF_ONE < abs((total := _sum(stage)) - 1.0) < _WHOLE_NUMBERS:
            yield f"coefficients of {name} sum to {total:.3g} and not to 1: signs may be lost"
        listed = getattr(stage, "response_list_elements", ())
        if any(float(one.amplitude) < 0.0 for one in listed):
            yield f"amplitudes of {name} are below 0, which its phases are for"
        if str(getattr(stage, "pz_transfer_function_type", "")) in _LAPLACE:
            poles, zeros = (np.array(of, complex) for of in (stage.poles, stage.zeros))
            if not (_conjugate(poles) and _conjugate(zeros)):
                yield f"poles or zeros of {name} lack their conjugates: signs may be lost"
            if (poles.real > 0.0).any():
                yield f"poles of {name} grow with time: signs may be lost"


def _sum(stage: Any) -> float:
    """Sum of the coefficients of a digital filter without feedback, 1 of any other stage."""
    symmetry = str(getattr(stage, "symmetry", ""))
    given = stage.coefficients if symmetry else getattr(stage, "numerator", ())
    if not given or getattr(stage, "denominator", None):
        return 1.0
    half = np.array([float(one) for one in given])
    middle = {"EVEN": 0.0, "ODD": half[-1]}.get(symmetry)
    return float(half.sum() if middle is None else 2.0 * half.sum() - middle)


def _conjugate(roots: Array) -> bool:
    """Whether the conjugate of each root is among them."""
    apart = np.abs(roots[:, None] - roots.conj()).min(axis=1, initial=math.inf)
    return bool((apart <= _SAME_ROOT * np.abs(roots)).all())


_OFF_ONE = 0.05
"""How far the sum of a filter's coefficients may be from 1: in ObsPy's tests those of one station
are farther."""

_WHOLE_NUMBERS = 100.0
"""From which on a sum is of coefficients in whole numbers, as 4096 of some stations of the USGS."""

_SAME_ROOT = 1e-3
"""How far, by its size, a root may be from the conjugate of another: they are written in digits."""

FAINTEST = 0.1
"""Least response divided by above its greatest, as a share of that: the last digits of counts grow
by ten times. In a digitizer's filter they grow up to a million times, beyond any PGA of shaking."""


def _check_upper_corners(trace: Any, corners: Corners) -> None:
    """Refuse corners up to where the response, in the instrument's own quantity, is faint.

    Towards long periods it may be: there a record is told by more samples, and high-passed.
    """
    nyquist, key = 0.5 / trace.stats.delta, "motion.response.corners"
    if corners[1] >= nyquist:
        given = f"{key} above {corners[1]:g} Hz"
        rule = f"a record of {2.0 * nyquist:g} samples a second tells up to {nyquist:g} Hz"
        raise InvalidInput(given, rule, "correct the corners, which are in Hz")
    band = np.linspace(0.0, min(corners[3], nyquist), 2001)[1:]
    found = trace.stats.response.get_evalresp_response_for_frequencies(
        band, "DEF", None, None, True
    )
    greatest = int(np.abs(found).argmax())
    above, share = band[greatest:], np.abs(found[greatest:] / found[greatest])
    fallen = np.clip((above - corners[2]) / (corners[3] - corners[2]), 0.0, 1.0)
    if (0.5 + 0.5 * np.cos(np.pi * fallen) > share / FAINTEST).any():
        hertz = above[share < FAINTEST][0]
        given = f"{key} that end at {corners[3]:g} Hz"
        rule = f"from {hertz:.3g} Hz on, the response for {trace.id} is less than {FAINTEST:.0%} of"
        rule += " its greatest, and dividing by it makes shaking of the last digits"
        raise InvalidInput(given, rule, f"end {key} there, or lower")


def _with_ends(values: Array, number: int) -> Array:
    """Values that begin at zero and end there, by half a cosine before them and one after them.

    A step would ring (also less than four samples do), one taken off the values themselves would
    take shaking with it, and a slow one is a large wave once divided by a geophone's response.
    """
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(number) / number)
    return np.concatenate([values[0] * rise, values, values[-1] * rise[::-1]])


_MOTION = re.compile(
    r"([NCM]?)M(?:/S(?:EC)?|/S\*\*2)|M/(?:\(S\*\*2\)|SEC\*\*2|\(SEC\*\*2\)|S/S)", re.IGNORECASE
)
"""Units of velocity and acceleration that ObsPy divides by: in others that it lists, as CM/SEC**2,
it forgets the factor, and what it does not list it takes as it is. What records displacement does
so in too few digits for an acceleration."""

_IN_METRE = {"": 1.0, "C": 1e2, "M": 1e3, "N": 1e9}


def _check_response(response: Any) -> None:
    """Refuse the response of no motion, and one whose stages are not what it says altogether."""
    whole, remedy = response.instrument_sensitivity, "correct the response, or download it again"
    first, finer = response.response_stages[0], 1.0
    units = [one.input_units for one in (whole, first) if one and one.input_units] or ["no unit"]
    for unit in units:
        motion = _MOTION.fullmatch(unit)
        if not motion:
            given = f"the response of an instrument in {unit}"
            rule = "it records velocity or acceleration, in units such as M/S or M/S**2"
            raise InvalidInput(given, rule, remedy)
        finer = _IN_METRE[(motion[1] or "").upper()]
    if len(set(map(_spelt_alike, units))) > 1:
        given = f"a response in {units[0]} whose first stage is in {units[1]}"
        raise InvalidInput(given, "the two agree", remedy)
    if whole and whole.value is not None:
        at = whole.frequency or first.stage_gain_frequency or 0.0
        frequencies = [at, 1.0]  # one at least is not zero, as a list of responses needs
        found, _ = response.get_evalresp_response_for_frequencies(
            frequencies, "DEF", None, None, True
        )
        ratio = abs(found / finer / (whole.value or math.nan))
        if not 1.0 / _ALIKE <= ratio <= _ALIKE:
            given = f"a response whose stages have {ratio:.3g} times the sensitivity that it says"
            given += f", at {at:g} Hz"
            raise InvalidInput(given, f"the two agree within a factor of {_ALIKE:g}", remedy)
    for stage in response.response_stages:
        if turning := _LAPLACE.get(str(getattr(stage, "pz_transfer_function_type", ""))):
            _check_normalization(stage, turning)


def _check_normalization(stage: Any, turning: complex) -> None:
    """Refuse poles and zeros that contradict the factor with which they are 1 at a frequency.

    Where the stage's gain is of another frequency ObsPy forgets the factor, and with it a zero too
    many. Of the samples in ObsPy's tests, those of velocity and acceleration are 0.7 to 1.7.
    """
    if at := turning * (stage.normalization_frequency or 0.0):
        over, under = (np.prod([at - root for root in of]) for of in (stage.zeros, stage.poles))
        ratio = abs(stage.normalization_factor * over / under)
        if not 1.0 / _ALIKE <= ratio <= _ALIKE:
            given = f"poles and zeros that are {ratio:.3g} at {stage.normalization_frequency:g} Hz"
            given += ", with their normalization factor"
            rule = f"they are 1 there, within a factor of {_ALIKE:g}"
            raise InvalidInput(given, rule, "correct the response, or download it again")


_LAPLACE = {"LAPLACE (RADIANS/SECOND)": 2j * math.pi, "LAPLACE (HERTZ)": 1j}
"""Laplace's variable at 1 Hz, by the units of poles and zeros."""


def _spelt_alike(unit: str) -> str:
    """A unit in one of its spellings.

    >>> {_spelt_alike(unit) for unit in ("m/s**2", "M/(SEC**2)", "M/S/S")}
    {'M/S**2'}
    """
    return re.sub(r"EC|[()]", "", unit.upper()).replace("S/S", "S**2")
