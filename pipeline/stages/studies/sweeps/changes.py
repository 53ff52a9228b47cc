"""What changes along a dimension of a sweep, and by how much against the numerical error."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
import xarray as xr

from pipeline.config.refusals import meaning
from pipeline.config.sweep import GRIDS, Dimension, Sweep
from pipeline.workflow.datasets import catalogue, labelled, spelled
from pipeline.workflow.grammar import counted, listed
from vsr_core import GRAVITY
from vsr_core.arrays import Array

BOUNDARY = "first_overturning_pga"
LOWER, UPPER = f"{BOUNDARY}_lower", f"{BOUNDARY}_upper"
_NUMBERS = re.compile(r"[-+.\dex ]+")


def quantity(key: str) -> tuple[str, str]:
    """What a swept key means, and its unit: as datasets have it, or else the configuration.

    >>> quantity("contact.friction")
    ('Coulomb friction of the pair rock-pedestal', '1')
    >>> quantity("simulation.time_step")
    ('time step', 's')
    """
    if key in GRIDS:
        entry = catalogue()[GRIDS[key]]
        return entry["long_name"], entry["units"]
    text, unit = meaning(key)
    return text.partition(";")[0], unit


def axis_label(dimension: Dimension) -> str:
    """Label of an axis along a dimension."""
    return labelled(*quantity(dimension.key))


def places(dimension: Dimension) -> list[str]:
    """What to call each place along a dimension, with the unit of its numbers.

    >>> places(Dimension("yaw", {"yaw": (0, 90)}, ("0", "90"), 0, gridded=True))
    ['0 deg', '90 deg']
    """
    unit = spelled(quantity(dimension.key)[1])
    return [
        f"{label} {unit}" if unit and _NUMBERS.fullmatch(label) else label
        for label in dimension.labels
    ]


@dataclass(frozen=True)
class Change:
    """One place along a dimension, compared with the reference.

    A row is a direction, friction and PGV/PGA. Its boundary is known to an interval, widened by the
    error of the time step; two boundaries are apart where these intervals are.

    Attributes
    ----------
    mean, low, high : float, change of the boundary [1]: geometric mean, 10 and 90 % of all rows
    apart, rows : int, rows whose boundaries are apart, and all that can be compared
    lost, gained, lowest : int, rows whose change is not known: that topple at the reference and not
        here, here and not at the reference, or at the lowest PGA that was tried, at either
    toppled : float, share of the decided runs that topple
    bounded : bool, whether something topples, on the grid or beyond it
    time_step : float [s]
    error : float, numerical error of the boundary [1]; nan where it was not measured
    interval : float, half the interval of the boundary in the median row, as a share of it [1]
    """

    label: str
    is_reference: bool
    mean: float
    low: float
    high: float
    apart: int
    rows: int
    lost: int
    gained: int
    lowest: int
    toppled: float
    bounded: bool
    time_step: float
    error: float
    interval: float

    @property
    def without(self) -> int:
        """Rows that the mean leaves out."""
        return self.lost + self.gained + self.lowest

    @property
    def share(self) -> float:
        """Share of the rows that are apart."""
        return self.apart / self.rows if self.rows else np.nan


def along(data: xr.Dataset, sweep: Sweep, dimension: Dimension) -> xr.Dataset:
    """The part along one dimension, at the references of all others.

    Boundaries of rows that topple at the lowest PGA are -inf, and so below all others in a median:
    the value that is stored for them is an assumption.
    """
    others = {one.name: one.reference for one in sweep.dimensions if one is not dimension}
    part = data.isel(others)
    if BOUNDARY not in part:
        return part
    above = part[LOWER].notnull() | ~np.isfinite(part[UPPER])
    return part.assign({name: part[name].where(above, -np.inf) for name in (BOUNDARY, LOWER)})


def changes(data: xr.Dataset, dimension: Dimension) -> list[Change]:
    """Compare each place along a dimension with the reference, on the rows that both have run."""
    name = dimension.name
    members = [data.isel({name: n}) for n in range(data.sizes[name])]
    return [
        _change(place, members[dimension.reference], label, same=n == dimension.reference)
        for n, (place, label) in enumerate(zip(members, places(dimension), strict=True))
    ]


def _change(here: xr.Dataset, there: xr.Dataset, label: str, *, same: bool) -> Change:
    both = np.isfinite(here[LOWER]) & np.isfinite(there[BOUNDARY])
    ratio = (here[BOUNDARY] / there[BOUNDARY]).where(both).values - 1.0
    known = ratio[np.isfinite(ratio)]
    low, high = np.quantile(known, (0.1, 0.9)) if known.size else (np.nan, np.nan)
    (own_low, own_high), (other_low, other_high) = _interval(here), _interval(there)
    compared = (own_low.notnull() & other_low.notnull()).values
    apart = ((own_low > other_high) | (own_high < other_low)).values & compared
    decided = (here["overturned"] >= 0).sum().item()
    topples = np.isfinite(here[UPPER]) & np.isfinite(there[UPPER])
    lowest = topples & (np.isinf(here[BOUNDARY]) | np.isinf(there[BOUNDARY]))
    half = 0.5 * (here[UPPER] - here[LOWER]) / here[BOUNDARY]
    return Change(
        label,
        same,
        mean=float(np.expm1(np.log1p(known).mean())) if known.size else np.nan,
        low=float(low),
        high=float(high),
        apart=int(apart.sum()),
        rows=int(compared.sum()),
        lost=int((np.isfinite(there[UPPER]) & (here[BOUNDARY] == np.inf)).sum()),
        gained=int((np.isfinite(here[UPPER]) & (there[BOUNDARY] == np.inf)).sum()),
        lowest=int(lowest.sum()),
        toppled=(here["overturned"] == 1).sum().item() / decided if decided else np.nan,
        bounded=bool(np.isfinite(here[UPPER]).any()),
        time_step=_largest(here["time_step"]),
        error=_largest(here["boundary_error"]),
        interval=_median(half.values),
    )


def _interval(data: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray]:
    """Ends of the boundary's interval; infinite above where nothing topples, nan where none ran."""
    error = data["boundary_error"].fillna(0.0)
    return data[LOWER].clip(min=0.0) * (1.0 - error), data[UPPER] * (1.0 + error)


def typical(curves: xr.Dataset, kept: tuple[str, ...]) -> xr.Dataset:
    """Medians of boundaries over all other dimensions; nan between -inf and inf."""
    with np.errstate(invalid="ignore"):
        return curves.median([dim for dim in curves[BOUNDARY].dims if dim not in kept])


def collapsed(data: xr.Dataset) -> xr.Dataset | None:
    """Boundaries in the rock's own units, where the rock changes along a dimension.

    Rocks of one shape topple alike at the same PGA if PGV/PGA goes with the time sqrt(R / g); the
    steady acceleration that topples a rock is the unit of the PGA of slender ones.

    Returns
    -------
    Dataset or None
        Boundaries in units of the steady acceleration [1], and ``time``, the rock's [s].
    """
    if "static_pga" not in data or np.ptp(data["rock_radius"].values) == 0.0:
        return None
    time = np.sqrt(data["rock_radius"] / GRAVITY)
    return xr.Dataset({BOUNDARY: data[BOUNDARY] / data["static_pga"], "time": time})


SAME = 1e-3
"""Difference in ln PGV/PGA below which two rows are one."""


def spread(own: xr.Dataset, dimension: Dimension) -> tuple[float, float]:
    """How far apart the boundaries in the rock's own units are.

    Returns
    -------
    tuple of float
        Median and largest difference from the reference, as shares, where both have a row at the
        same PGV/PGA in the rock's own time.
    """
    name, found = dimension.name, []
    curves = typical(own[[BOUNDARY]], (name, "pgv_pga"))[BOUNDARY]
    ratio = own["pgv_pga"].values
    for n in range(own.sizes[name]):
        known = np.isfinite(curves.isel({name: n}).values)
        x = np.log(ratio / own["time"].isel({name: n}).item())[known]
        found.append((x, np.log(curves.isel({name: n}).values[known])))
    x, y = found[dimension.reference]
    apart = [np.empty(0)]
    for n, (other, values) in enumerate(found):
        own_row, row = np.nonzero(np.abs(x[:, None] - other) < SAME)
        if n != dimension.reference:
            apart.append(np.abs(values[row] - y[own_row]))
    every = np.expm1(np.concatenate(apart))
    return (float(np.median(every)), float(every.max())) if every.size else (np.nan, np.nan)


def _largest(values: xr.DataArray) -> float:
    known = values.values[np.isfinite(values.values)]
    return float(known.max()) if known.size else np.nan


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else np.nan


HALF = 0.5
"""Share of the PGV/PGA levels that must differ significantly for a change to count."""

RARE = 0.1
"""Share of the PGV/PGA levels below which a change is called rare."""

MOST_NAMED = 6
"""Values that a sentence names."""


def headline(sweep: Sweep, found: list[str], site: str) -> str:
    """The first sentence of the page.

    Parameters
    ----------
    found : list of str, what is said of each dimension; none where no boundary was computed
    """
    if not found:
        sizes = [
            f"{counted(len(one.labels), 'value')} of {quantity(one.key)[0]}"
            for one in sweep.dimensions
        ]
        return f"{site} at {listed(sizes)}."
    return " ".join(found)


def about(
    dimension: Dimension,
    changes: list[Change],
    spread: tuple[float, float] | None,
    constant: list[str],
) -> str:
    """Say how far the boundary moves along a dimension, and whether that is more than its error.

    Parameters
    ----------
    constant : list of str, the other dimensions, each at its reference
    """
    own = ""
    if spread is not None and np.isfinite(spread[0]):
        own = (
            f"The normalised boundaries differ by {100 * spread[0]:.2f} % in the "
            f"median and {100 * spread[1]:.2f} % at most."
        )
    moved, unknown = _moved(dimension, changes), _unknown(dimension, changes)
    sentences = (moved, unknown, _none(changes), _beyond(changes), own)
    where = f"At {listed(constant)}: " if constant else ""
    return where + " ".join(filter(None, sentences))


def _moved(dimension: Dimension, changes: list[Change]) -> str:
    """Largest shifts of the boundary, averaged over its rows."""
    reference = places(dimension)[dimension.reference]
    known = [one for one in changes if not one.is_reference and np.isfinite(one.mean)]
    if not known:
        return f"No PGV/PGA level has a boundary at both {dimension.name} {reference} and another."
    least, most = (pick(known, key=lambda one: one.mean) for pick in (min, max))
    against = f"Compared with {dimension.name} {reference}, the boundary, averaged over PGV/PGA,"
    if _percent(least.mean) == _percent(most.mean) == "0 %":
        return f"{against} does not move."
    if _percent(least.mean) == _percent(most.mean):
        return f"{against} moves by {_percent(most.mean)} at {_named([o.label for o in known])}."
    low, high = (f"{_percent(one.mean)} at {one.label}" for one in (least, most))
    return f"{against} moves by {low} to {high}."


def _unknown(dimension: Dimension, changes: list[Change]) -> str:
    """Places that have no row in common with the reference."""
    reference = places(dimension)[dimension.reference]
    if not (labels := [one.label for one in changes if not one.is_reference and not one.rows]):
        return ""
    why = f"no PGV/PGA level has decided runs both there and at {reference}"
    return f"At {_named(labels)} the change is not known: {why}."


def _none(changes: list[Change]) -> str:
    """Where nothing topples, and at how many PGV/PGA levels elsewhere."""
    safe = [one.label for one in changes if one.toppled == 0.0 and not one.bounded]
    left = [one for one in changes if one.label not in safe]
    kinds = {
        "that do not topple up to the highest PGA tried there": [(one, one.lost) for one in left],
        "that do not topple at the reference up to the highest PGA tried": [
            (one, one.gained) for one in left
        ],
        "that topple at the lowest PGA tried": [
            (one, one.lowest) for one in left if not one.is_reference
        ],
    }
    said = [
        f"This excludes PGV/PGA levels {kind}: {_counts([one for one in found if one[1]])}."
        for kind, found in kinds.items()
        if any(count for _, count in found)
    ]
    if safe:
        said.append(f"At {_named(safe)} nothing topples up to the highest PGA tried there.")
    return " ".join(said)


def _counts(found: list[tuple[Change, int]]) -> str:
    """How many of the rows of each place; of many places, the first."""
    counts = ", ".join(f"{count} of {one.rows} at {one.label}" for one, count in found[:MOST_NAMED])
    more = len(found) - MOST_NAMED
    return f"{counts} and at {more} more" if more > 0 else counts


def _beyond(changes: list[Change]) -> str:
    """Whether the changes are more than errors."""
    others = [one for one in changes if not one.is_reference and one.rows]
    strong = [one.label for one in others if one.share >= HALF]
    if not others:
        return ""
    beyond = "beyond the numerical errors and the intervals"
    if any(math.isnan(one.error) for one in changes):
        beyond = "beyond the intervals (not all numerical errors were measured)"
    touched = max(others, key=lambda one: one.share)
    where = f"{touched.apart} of {counted(touched.rows, 'PGV/PGA level')} at {touched.label}"
    if strong:
        return f"The change is {beyond} at half or more of the PGV/PGA levels at {_named(strong)}."
    if touched.apart == 0:
        return f"At no PGV/PGA level is the change {beyond}."
    if touched.share < RARE:
        return f"A change {beyond} is rare: at most {where}."
    return f"The change is {beyond} at up to {where}."


def _named(labels: list[str]) -> str:
    """Values in a sentence; of many, their number."""
    return f"{len(labels)} values" if len(labels) > MOST_NAMED else listed(labels)


def _percent(share: float) -> str:
    """A change in per cent with its sign.

    >>> _percent(0.0123), _percent(-0.2), _percent(1e-9), _percent(0.997)
    ('+1.2 %', '\N{MINUS SIGN}20 %', '0 %', '+100 %')
    """
    if abs(share) < 5e-4:
        return "0 %"
    text = f"{100 * share:+.2g} %" if abs(share) < 0.1 else f"{100 * share:+.0f} %"
    return text.replace("-", "\N{MINUS SIGN}")
