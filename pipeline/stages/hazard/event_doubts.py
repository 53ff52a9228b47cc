"""What the shaking of simulated events has that no simulation gives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.stats import rankdata

from pipeline.config.sections import LARGEST_RATIO, LEAST_RATIO, STRONG_PGA
from pipeline.stages.hazard.hazard_model import UNITS
from pipeline.workflow.grammar import counted
from vsr_core.arrays import Array, Indices
from vsr_core.motions.order import repeated

_FEWEST, _FOLLOWS = 100, 0.98
"""Events whose order tells; and the rank correlation of each with the next that none reach, also
where those of near ruptures and of far ones stand together."""

_IN_A_ROW = 10
"""Events whose shaking is nowhere that of others, to the last digit."""

_SCATTER = 10.0
"""Times as far as PGV/PGA of earthquakes goes, as it does where both are drawn apart."""


def _with_next(values: Array) -> float:
    """Rank correlation of each value with the next one, or its size."""
    ranks = rankdata(values)
    return float(abs(np.corrcoef(ranks[1:], ranks[:-1])[0, 1]))


def doubts(pga: Array, pgv: Array | None) -> Iterator[str]:
    """Shaking that is sorted, there twice, or beyond any, in words.

    Parameters
    ----------
    pga, pgv : ndarray, shape (events,) [g], [cm/s], in the order of events
    """
    for name, values in (("gmv_PGA", pga), ("gmv_PGV", pgv)):
        felt = values[values > 0.0] if values is not None else np.zeros(0)
        if len(felt) < _FEWEST or not np.ptp(felt):
            continue
        as_text = felt / 10.0 ** np.floor(np.log10(felt))
        if max(map(_with_next, (felt, as_text))) > _FOLLOWS:
            yield f"{name} follows the numbers of events: it may be sorted"
        elif again := repeated(felt, _IN_A_ROW, -1.0):
            yield f"{name} of {again:,} events is that of others before, in their order"
    if (number := int((pga > STRONG_PGA).sum())) > 0:
        said = f"{counted(number, 'event')} with PGA of up to {pga.max():.3g} g"
        yield f"{said}, and records rarely exceed {STRONG_PGA:g} g"
    if pgv is not None:
        both = (pga > 0.0) & (pgv > 0.0)
        ratio = UNITS["PGV"] * pgv[both] / (UNITS["PGA"] * pga[both])
        beyond = (ratio * _SCATTER < LEAST_RATIO) | (ratio > LARGEST_RATIO * _SCATTER)
        if beyond.any():
            said = f"{counted(int(beyond.sum()), 'event')} with PGV/PGA from {ratio.min():.2g}"
            yield f"{said} to {ratio.max():.2g} s, of which earthquakes have 0.02 to 0.5 s"


def of_years(year: Indices, realization: Indices, years: float) -> Iterator[str]:
    """Events in the years of another realization than theirs, where they follow each other.

    Parameters
    ----------
    year : ndarray of int, shape (events,), from 1 on
    realization : ndarray of int, shape (events,), number of each event's one
    years : float, of each realization
    """
    blocks = (year - 1) // years
    if blocks.any() and (beside := int((blocks != realization).sum())):
        yield f"{counted(beside, 'event')} in the {years:g} years of another realization"
