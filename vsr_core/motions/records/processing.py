"""From a repaired record to a motion: filters and baseline correction, only as configured.

Two orders, both with Butterworth filters run forward and backward over a record with zeros at both
ends. The zeros stay: the filters' response runs out in them, and without it velocity and
displacement are not those of the filtered acceleration (Boore 2005).

``paper``: low-pass the acceleration, integrate, high-pass the velocity (Chen et al. 2024). Filters
and integration are linear and do not change with time, so that the acceleration of the high-passed
velocity is the high-passed acceleration; that is what is computed.

``standard``: subtract the line of least squares, band-pass, and subtract from the acceleration the
second derivative of a polynomial of degree six, without its first two powers, fitted to the
displacement (PEER's and most networks' procedure).

``none``: the samples as they are.

References
----------
Boore, D. M. (2005), On pads and filters, BSSA 95(2), 745-750.
Boore, D. M. & Bommer, J. J. (2005), Soil Dyn. Earthq. Eng. 25(2), 93-115.
Ancheta, T. D. et al. (2014), NGA-West2 database, Earthquake Spectra 30(3), 989-1005.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import scipy

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import check_sampling
from vsr_core.motions.records.trace import Trace

POWERS = range(2, 7)
"""Powers of the baseline's polynomial."""

HIGHEST = 0.9
"""Highest corner, as a share of the Nyquist frequency."""

PADS = 1.5
"""Length of the zeros at both ends together, in units of poles over the high-pass corner (Converse
& Brady 1992)."""

MOST_OF_OFFSET = 0.05
"""Share of PGV that the ends of a record's offset may have."""

STILL = 1e-3
"""Share of its largest acceleration up to which the ends of a record are padding."""

FEWEST = 16
"""Samples that a record has at least."""


@dataclass(frozen=True)
class Processing:
    """What is done to a record.

    Attributes
    ----------
    highpass, lowpass : float or None [Hz], corners (-3 dB of one pass); None leaves a filter out
    resample : float or None [1/s], new rate, band-limited
    """

    order: str
    highpass: float | None
    lowpass: float | None
    poles: int = 4
    resample: float | None = None


def process(acceleration: Array, interval: float, how: Processing) -> Trace:
    """The motion of a repaired record.

    Parameters
    ----------
    acceleration : ndarray, shape (n,) [m/s^2], finite
    interval : float [s]

    Raises
    ------
    InvalidInput
        If a corner is out of reach of the record's length or rate.
    """
    if len(acceleration) < FEWEST:
        raise InvalidInput(
            f"a record of {len(acceleration)} samples", f"it has {FEWEST} or more", "use another"
        )
    if how.resample is not None:
        check_sampling(1.0 / how.resample, len(acceleration) * interval * how.resample)
        acceleration, interval = resampled(acceleration, interval, how.resample)
    _check_corners(how, interval, len(acceleration))
    if how.order == "none":
        return Trace(acceleration, interval)
    if how.order == "standard":
        acceleration = scipy.signal.detrend(acceleration, type="linear")
    passed = _passed(acceleration, interval, how)
    if how.order == "standard":
        return Trace(with_level_baseline(passed, interval), interval)
    if how.highpass is not None:
        _check_offset(acceleration, interval, how, passed)
    return Trace(passed, interval)


def _check_offset(acceleration: Array, interval: float, how: Processing, passed: Array) -> None:
    largest = float(np.abs(acceleration).max())
    known = np.flatnonzero(np.abs(acceleration) > STILL * largest)
    if not known.size:
        return
    of_record = slice(known[0], known[-1] + 1)  # between what others put at its ends
    # A ground that rests before and after has no mean acceleration.
    offset, step = float(acceleration[of_record].mean()), np.zeros_like(acceleration)
    step[of_record] = offset
    of_offset = _passed(step, interval, how)
    own, whole = (float(np.abs(Trace(one, interval).velocity).max()) for one in (of_offset, passed))
    if own > MOST_OF_OFFSET * whole:
        share = abs(offset) / largest
        given = f"an offset of {100.0 * share:.2g} % of its largest acceleration"
        rule = f"order {how.order} takes none off, and where it begins and ends it would count as "
        rule += f"shaking of {100.0 * own / whole:.0f} % of PGV"
        raise InvalidInput(given, rule, "set motion.processing.order: standard")


def _passed(acceleration: Array, interval: float, how: Processing) -> Array:
    """What the filters leave, between zeros."""
    if how.highpass is not None:
        pads = pad_length(how, interval)
        check_sampling(interval, len(acceleration) + 2 * pads)
        acceleration = np.pad(acceleration, pads)
    for kind, corner in (("lowpass", how.lowpass), ("highpass", how.highpass)):
        if corner is not None:
            acceleration = filtered(acceleration, interval, kind, corner, how.poles)
    return acceleration


def pad_length(how: Processing, interval: float) -> int:
    """Zeros at each end.

    Parameters
    ----------
    interval : float [s]

    Examples
    --------
    >>> pad_length(Processing("paper", highpass=0.5, lowpass=None), 0.01)
    600
    """
    assert how.highpass is not None
    return int(np.ceil(0.5 * PADS * how.poles / how.highpass / interval))


def filtered(values: Array, interval: float, kind: str, corner: float, poles: int) -> Array:
    """Butterworth filter, forward and backward from rest: no phase, twice the attenuation.

    Parameters
    ----------
    values : ndarray, shape (n,)
    interval : float [s]
    corner : float [Hz]

    Returns
    -------
    ndarray, shape (n,)
    """
    sections = scipy.signal.butter(poles, corner, kind, fs=1.0 / interval, output="sos")
    forward = scipy.signal.sosfilt(sections, values)
    backward: Array = scipy.signal.sosfilt(sections, forward[::-1])[::-1]
    return np.ascontiguousarray(backward)


def with_level_baseline(acceleration: Array, interval: float) -> Array:
    """The acceleration whose displacement has no polynomial of powers 2 to 6 left in it.

    What is fitted is each power's own displacement, as ``Trace`` integrates it, so that the
    residual of the fit is the displacement of the result, to rounding.

    Parameters
    ----------
    acceleration : ndarray, shape (n,) [m/s^2]
    interval : float [s]

    Returns
    -------
    ndarray, shape (n,) [m/s^2]
    """
    span = np.linspace(0.0, 1.0, len(acceleration))
    basis = [power * (power - 1) * span ** (power - 2) for power in POWERS]
    traces = [Trace(shape, interval).displacement for shape in basis]
    scale = [float(np.abs(trace).max()) for trace in traces]
    columns = np.column_stack([t / s for t, s in zip(traces, scale, strict=True)])
    wanted = Trace(acceleration, interval).displacement
    weights = np.linalg.lstsq(columns, wanted, rcond=None)[0]
    drift = np.column_stack([b / s for b, s in zip(basis, scale, strict=True)]) @ weights
    level: Array = acceleration - drift
    return level


_WRITTEN = 1.1e-4
"""Share by which time steps are written off a rate in tenths, rounded: .003333 s of 1/300."""

_LARGEST_PART = 1000
"""Of the ratio of two rates, of whole numbers."""


def resampled(values: Array, interval: float, rate: float) -> tuple[Array, float]:
    """The values at another rate, by a band-limited filter.

    Parameters
    ----------
    values : ndarray, shape (n,)
    interval : float [s]
    rate : float [1/s]

    Returns
    -------
    values : ndarray, shape (m,)
    interval : float [s]

    Raises
    ------
    InvalidInput
        If the two rates have no simple ratio.
    """
    told = round(10.0 / interval) / 10.0
    wanted = rate / told if abs(told * interval - 1.0) < _WRITTEN else rate * interval
    up, down = Fraction(wanted).limit_denominator(_LARGEST_PART).as_integer_ratio()
    if abs(up / down - wanted) > 1e-9 * wanted:
        given = f"a rate of {rate:g} for a record of {1.0 / interval:.6g} samples a second"
        rule = f"the two have a ratio of whole numbers, the second up to {_LARGEST_PART}"
        raise InvalidInput(given, rule, "choose such a motion.processing.resample")
    new: Array = scipy.signal.resample_poly(values, up, down, padtype="line")
    return new, interval * down / up


def _check_corners(how: Processing, interval: float, number: int) -> None:
    nyquist, length = 0.5 / interval, number * interval
    if how.lowpass is not None and how.lowpass > HIGHEST * nyquist:
        given = f"a low-pass at {how.lowpass:g} Hz for {1.0 / interval:.5g} samples a second"
        rule = f"it lies below {HIGHEST * nyquist:.4g} Hz, nine tenths of the Nyquist frequency"
        raise InvalidInput(given, rule, "lower motion.processing.lowpass, or set it to null")
    if how.highpass is not None and how.highpass * length < 1.0:
        given = f"a high-pass at {how.highpass:g} Hz for a record of {length:.4g} s"
        remedy = f"raise motion.processing.highpass to {1.0 / length:.3g} Hz or more"
        raise InvalidInput(given, "its period fits into the record", remedy)
