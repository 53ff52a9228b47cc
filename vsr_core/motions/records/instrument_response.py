"""The response of an instrument, divided out of what it recorded."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import check_samples
from vsr_core.motions.records.station import channel_of

Corners = tuple[float, float, float, float]

_GAINS_ALIKE = 3.0
"""Factor within which a gain is that of its stages."""


def without_response(stream: Any, inventory: Any, corners: Corners | None) -> Any:
    """An ObsPy stream of accelerations [m/s^2], its gaps masked.

    Parameters
    ----------
    inventory : ObsPy's, of the channels
    corners : tuple of float [Hz], of the cosine taper of the spectrum

    Raises
    ------
    InvalidInput
        Without corners, or for a response of no motion, or one that contradicts itself or changes.
    """
    if corners is None:
        given = "a response without corners"
        rule = "dividing by it needs a band, or it makes noise of the ends of the spectrum"
        raise InvalidInput(given, rule, "give motion.response.corners, four frequencies [Hz]")
    stream.merge()
    for trace in stream:
        trace.stats.response = channel_of(trace, inventory).response
        _check_response(trace.stats.response)
        counts = np.ma.masked_invalid(np.ma.asarray(trace.data).astype(np.float64))
        missing, places = np.ma.getmaskarray(counts), np.arange(len(counts))
        there = places[~missing]  # a line between velocities would have jumps of acceleration
        within = np.clip(places, there[0], there[-1])
        whole = CubicSpline(there, counts.data[~missing])(within) if missing.any() else counts.data
        if np.ptp(whole):  # the taper makes a smooth pulse of what is no sample
            check_samples(whole, f"counts of {trace.stats.channel}", trace.stats.delta)
        line = np.polyval(np.polyfit(places, whole, 1), places)
        ends = min(math.ceil(1.0 / (corners[1] * trace.stats.delta)), len(whole))
        trace.data = _with_ends(whole - line, ends)
        trace.remove_response(output="ACC", water_level=None, pre_filt=corners, taper=False)
        trace.data = np.ma.masked_array(trace.data[ends : ends + len(whole)], missing)
    return stream


def _with_ends(values: Array, number: int) -> Array:
    """Values that begin at zero and end there, by half a cosine before them and one after them.

    A step would ring, and one taken off the values themselves would take shaking with it.
    """
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(number) / number)
    return np.concatenate([values[0] * rise, values, values[-1] * rise[::-1]])


_MOTION = re.compile(
    r"[NCM]?M(/S(EC)?|/S\*\*2)?|M/(\(S\*\*2\)|SEC\*\*2|\(SEC\*\*2\)|S/S)", re.IGNORECASE
)
"""Units of displacement, velocity and acceleration that ObsPy divides by: in others that it lists,
as CM/SEC**2, it forgets the factor, and what it does not list it takes as it is."""


def _check_response(response: Any) -> None:
    """Refuse the response of no motion, and one whose stages are not what it says altogether."""
    whole, remedy = response.instrument_sensitivity, "correct the response, or download it again"
    units = [one.input_units for one in (whole, *response.response_stages[:1]) if one]
    for unit in filter(None, units):
        if not _MOTION.fullmatch(unit):
            given = f"the response of an instrument in {unit}"
            raise InvalidInput(given, "it records motion, in units such as M/S or M/S**2", remedy)
    gains = [stage.stage_gain for stage in response.response_stages]
    if whole and whole.value is not None and None not in gains:
        ratio = abs(math.prod(gains) / (whole.value or math.nan))
        if not 1.0 / _GAINS_ALIKE <= ratio <= _GAINS_ALIKE:
            given = f"a response whose stages have {ratio:.3g} times the sensitivity that it says"
            raise InvalidInput(given, f"the two agree within a factor of {_GAINS_ALIKE:g}", remedy)
