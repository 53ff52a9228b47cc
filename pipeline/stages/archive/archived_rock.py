"""A rock of an archive as one of those that stand at a site: its fragility, by draws."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import ndtri

from pipeline.config.paths import shown
from pipeline.config.problems import InputError, Problem
from pipeline.stages.archive import rock_list, shipped_equations
from pipeline.stages.archive.rock_list import Archive
from vsr_core.archive.equations import HIGHEST
from vsr_core.archive.photographs import answers
from vsr_core.arrays import Array

PGV_PGA = (0.03, 0.04, 0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.4, 0.56, 0.8, 1.1)
"""Rows of PGV/PGA [s]."""

DRAWS = 64
"""Of what is not known of the rock, at equal steps of probability."""

SHARP = 0.01
"""Standard deviation of ln PGA in which a draw goes from standing to toppled: about what the runs
resolve."""


@dataclass(frozen=True, eq=False)
class Answered:
    """Boundaries of one rock by direction and PGV/PGA, and how certain they are.

    Attributes
    ----------
    directions : ndarray, shape (2,) [degree], of the first push
    median, log_sd : ndarray, shape (2, rows) [g] and [1], of what has a boundary
        Where none is known, the median is the PGA up to which it was looked for.
    none : ndarray, shape (2, rows), share without a boundary where one is known
    static : float [g]
    sliding : float, share of the frictions assumed with which it slides and stands
    age : float or None, mean age that the archive has [year]
    """

    directions: Array
    median: Array
    log_sd: Array
    none: Array
    static: float
    sliding: float
    age: float | None

    @property
    def farthest(self) -> float:
        """PGA up to which a boundary was looked for [g]."""
        return HIGHEST * self.static

    @property
    def draws(self) -> Array:
        """Boundaries of draws, shape (draws, 2, rows) [g]: what is not known is so of all rows.

        Those that slide have none: infinite, the last. Of the others the last are those without a
        boundary up to the farthest PGA, which is taken for them.
        """
        tips = DRAWS - round(DRAWS * self.sliding)
        found = np.full((DRAWS, *self.median.shape), np.inf)
        share = ((np.arange(tips) + 0.5) / tips)[:, None, None] / (1.0 - self.none)
        own = self.median * np.exp(ndtri(np.minimum(share, 1.0)) * self.log_sd)
        found[:tips] = np.where(share < 1.0, own, self.farthest)
        return found


def answered(path: Path, name: str) -> Answered:
    """Boundaries of a rock of an archive.

    Raises
    ------
    InputError
        If the archive has no such rock, or a faulty row of its name, or it slides.
    """
    archive = rock_list.read(path)
    if name in archive.problem_of:
        raise InputError(archive.problem_of[name])
    names = [rock.name for rock in archive.rocks]
    if name not in names:
        said = f"its rocks are {', '.join(names[:20])}" if names else "it has none"
        raise InputError(Problem(shown(path), "name", repr(name), "no such rock", said))
    one = Archive([archive.rocks[names.index(name)]], [], {})
    found = answers(one.seen, shipped_equations.load().equations, np.array(PGV_PGA))
    if found.slides[0]:
        rule, remedy = "friction is above tan(alpha)", "leave it out: it slides and stands"
        raise InputError(Problem(shown(path), "friction", f"{name!r}, which slides", rule, remedy))
    static = float(found.static[0])
    median = np.where(np.isnan(found.boundary[0]), HIGHEST * static, found.boundary[0])
    towards = one.rocks[0].azimuth_deg or 0.0
    directions = np.array([towards, towards + 180.0]) % 360.0
    return Answered(
        directions,
        median,
        found.log_sd[0],
        np.nan_to_num(found.none[0]),
        static,
        float(found.sliding[0]),
        one.rocks[0].age_mean_a,
    )
