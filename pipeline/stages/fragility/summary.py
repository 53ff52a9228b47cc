"""Numbers that figures and the report quote, each defined once."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config import in_si
from pipeline.stages.runs.quantity_errors import ENDS, IN_WORDS
from pipeline.stages.runs.step_choice import kept
from pipeline.workflow.datasets import Opened
from vsr_core.arrays import Array, Mask
from vsr_core.outcome import Outcome
from vsr_core.run.agreement import HIGHEST
from vsr_core.run.time_step import ENOUGH, Boundary

LONG_PULSE = 0.2
"""PGV/PGA [s] from which levels count towards the typical first-overturning PGA: below it the
boundary climbs steeply and says more about the grid's shortest pulse than about the rock."""

_WINDOW = 15
"""Half-width [degree] over which a weak direction is the weakest."""


@dataclass(frozen=True)
class Weak:
    """A direction in which the rock tips more easily than to either side of it.

    Attributes
    ----------
    direction : float [degree], in the rock's frame at yaw 0, counter-clockwise from +x
    angle : float [degree], static tipping angle
    pga : float [g], steady acceleration that topples that way
    """

    direction: float
    angle: float
    pga: float

    @property
    def yaw(self) -> float:
        """Yaw [degree] at which the first push of the pulse, to -x, goes that way."""
        return (180.0 - self.direction) % 360.0


def weak_directions(rock: xr.Dataset, most: int = 5) -> list[Weak]:
    """Local minima of the tipping PGA over the circle.

    Returns
    -------
    list of Weak, weakest first, ``most`` at the most
    """
    pga = np.round(rock["tipping_pga"].values, 6)  # symmetric directions differ in the last digits
    lowest = np.min([np.roll(pga, turn) for turn in range(-_WINDOW, _WINDOW + 1)], axis=0)
    least = pga == lowest
    starts = [int(i) for i in np.flatnonzero(least & ~np.roll(least, 1))] or [int(np.argmin(pga))]
    middles = [(i + _run(np.roll(least, -i)) // 2) % pga.size for i in starts]
    found = [
        Weak(*(float(rock[name][i]) for name in ("direction", "tipping_angle", "tipping_pga")))
        for i in middles
    ]
    return sorted(found, key=lambda weak: weak.pga)[:most]


def static_pga(rock: xr.Dataset, yaw: Array) -> Array:
    """Steady acceleration that topples the rock in either direction along the shaking.

    The pulse pushes both ways with the same peak, so the weaker direction counts.

    Parameters
    ----------
    yaw : ndarray [degree]

    Returns
    -------
    ndarray [g]
    """
    circle = np.append(rock["tipping_pga"].values, rock["tipping_pga"].values[0])
    degrees = np.arange(circle.size, dtype=float)
    directions = [np.interp((turn - yaw) % 360.0, degrees, circle) for turn in (180.0, 0.0)]
    weaker: Array = np.minimum(*directions)
    return weaker


def long_rows(ratios: Array) -> Mask:
    """Rows with PGV/PGA of at least ``LONG_PULSE``; all of them if there is none.

    Parameters
    ----------
    ratios : ndarray, shape (rows,) [s]

    Returns
    -------
    ndarray of bool, shape (rows,)

    >>> long_rows(np.array([0.1, 0.2, 0.4])).tolist()
    [False, True, True]
    """
    rows = ratios >= LONG_PULSE - 1e-9
    return rows if rows.any() else np.ones_like(rows)


def long_rows_in_words(ratios: Array) -> str:
    """Name the rows that ``long_rows`` takes.

    Parameters
    ----------
    ratios : ndarray, shape (rows,) [s]

    >>> long_rows_in_words(np.array([0.01, 0.1]))
    'all PGV/PGA'
    """
    least = ratios[long_rows(ratios)].min()
    return "all PGV/PGA" if least < LONG_PULSE - 1e-9 else f"PGV/PGA ≥ {LONG_PULSE:g} s"


def typical_pga(fragility: xr.Dataset) -> Array:
    """First-overturning PGA and the ends of its interval, each the median over the long rows.

    Of an even number it is the mean of the two in the middle. If one of these has an open interval,
    no more is known than that it lies between them: a mean would be a PGA that no row knows of.

    Returns
    -------
    ndarray, shape (3, yaw, friction) [g]
        PGA, lower and upper end: 0 and inf where the interval is open, and the PGA likewise, NaN
        where it is open to both sides; NaN without a decided run.
    """
    name, rows = "first_overturning_pga", long_rows(fragility["pgv_pga"].values)
    first, lower, upper = (
        fragility[name + end].values[..., rows] for end in ("", "_lower", "_upper")
    )
    decided = ~np.isnan(first)
    typical = np.full((3, *first.shape[:2]), np.nan)
    for place in np.argwhere(decided.any(axis=-1)):
        own = (*place, decided[tuple(place)])
        ends = np.sort((first[own], np.nan_to_num(lower[own], nan=0.0), upper[own]), axis=1)
        low, high = ends[:, (ends.shape[1] - 1) // 2], ends[:, ends.shape[1] // 2]
        middle = 0.5 * (low + high)
        if low[1] == 0.0 or np.isinf(high[2]):
            middle[1:] = low[1], high[2]
            middle[0] = float(low[1]) * float(high[2])  # 0, inf, or no number
        typical[(slice(None), *place)] = middle
    return typical


def groups(data: xr.Dataset) -> Iterator[tuple[tuple[int, int], str]]:
    """Each yaw and friction."""
    several = data.sizes["friction"] > 1
    for i, k in np.ndindex(data.sizes["yaw"], data.sizes["friction"]):
        friction = f", friction {float(data['friction'][k]):g}" if several else ""
        yield (i, k), f"yaw {float(data['yaw'][i]):g} deg{friction}"


def undecided(responses: xr.Dataset) -> Mask:
    """Find the unresolved runs."""
    codes = [outcome.value for outcome in Outcome if outcome.overturned == -1]
    outcome = responses["outcome"].values
    return np.isin(outcome, codes) | (responses["overturned"].values < 0)


def with_interval(first: float, lower: float, upper: float) -> str:
    """Say a first-overturning PGA and its interval, or the bound beyond which it lies.

    Parameters
    ----------
    first, lower, upper : float [g], a lower end of nan or 0 and an upper of inf where it is open

    Examples
    --------
    >>> with_interval(0.2, 0.1996, 0.2004), with_interval(math.inf, 4.0, math.inf)
    ('0.2000 [0.1996, 0.2004] g', 'above 4 g')
    """
    if math.isnan(upper) or (math.isinf(upper) and not lower > 0.0):
        return "not known"
    if math.isinf(upper):
        return f"above {lower:.4g} g"
    if not lower > 0.0:
        return f"below {upper:.4g} g"
    return f"{first:#.4g} [{lower:#.4g}, {upper:#.4g}] g"


def time_steps(measured: xr.Dataset) -> list[dict[str, Any]]:
    """Time step of each friction, the measured error of the boundary, and what it is measured on.

    Returns
    -------
    list of dict
        With ``rows``, for overturning and for displacement: how many have a boundary below
        ``highest`` [g], of which an error takes ``enough``, and how many were tried; and with
        ``kept``, in how many the error is kept, and of how many. Empty where the step was given.
        ``ground`` is what the rock stood on there. With ``others``, the errors of what
        ``simulation.accurate`` names besides the boundary.
    """
    names = ["boundary_error", "boundary_agreement", "boundary_error_worst", "displaced_error"]
    rows: list[Any] = (
        measured[["time_step", *names]].to_dataframe().reset_index().to_dict("records")
    )
    for at, row in enumerate(rows):
        row["others"] = [
            {"what": what, **{end: float(measured[f"{name}_error_{end}"][at]) for end in ENDS}}
            for name, what in IN_WORDS.items()
            if f"{name}_error_95" in measured
        ]
        row |= {"rows": [], "kept": [], "highest": in_si.in_g(HIGHEST), "enough": ENOUGH}
        if "row_reference" in measured:
            row["ground"] = measured.attrs["measured_on"]
            reference = measured["row_reference"].isel(friction=at).values
            for kind in (0, 1):
                own = reference[measured["row_displaced"].values == kind]
                row["kept"].append(kept(measured.isel(friction=at), Boundary(kind)))
                row["rows"].append((int(np.isfinite(own).sum()), int((~np.isnan(own)).sum())))
    return rows


def _run(flags: Mask) -> int:
    """Length of the run of true values at the start, less one."""
    return int(np.argmin(flags)) - 1 if not flags.all() else 0


TABLE = "fragility.csv"

SEARCHED = ("searched_from_g", "searched_to_g")
"""Attributes: PGAs [g] between which a boundary beyond the grid was looked for."""


class Fits(Opened):
    """Fitted models, and the boundary, of each direction and friction."""

    FILE = "fragility.nc"
