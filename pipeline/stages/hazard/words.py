"""The answer in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.config.hazard_schema import Age, BoundedAge, LognormalAge, NormalAge
from pipeline.workflow.grammar import form, listed
from vsr_core.arrays import Array, Mask

MOST_NAMED = 8
"""Branches that a sentence names; of more it gives the number."""


def percent(share: float) -> str:
    """A chance in percent, to two digits where it is small.

    Examples
    --------
    >>> percent(0.4123), percent(0.0523), percent(0.02), percent(0.0), percent(1.0)
    ('41 %', '5.2 %', '2.0 %', 'less than 0.01 %', '100 %')
    """
    if share < 1e-4:
        return "less than 0.01 %"
    return f"{100.0 * share:{'.0f' if share >= 0.0995 else '#.2g'}} %"


def sentence(
    names: Sequence[str],
    rejected: Mask,
    survival: Array,
    least: float,
    pga: tuple[float, float, float],
    rocks: int = 1,
) -> str:
    """What a hazard model is told by a rock.

    Parameters
    ----------
    rejected : ndarray of bool, shape (branches,)
    survival : ndarray, shape (branches,)
    least : float, chance of survival below which a branch is rejected
    pga : tuple of float [g]
        Exceeded once in 2,475 years before, without the rejected, and with the others weighed.

    Examples
    --------
    >>> gone = np.array([False, True, True])
    >>> said = sentence(["2", "3", "7"], gone, 0.01 * ~gone, 0.05, (0.41, 0.31, 0.29))
    >>> said[:72]
    'Branches 3 and 7 leave this rock less than 5 % chance of having survived'
    >>> said[72:132]
    '; without them the 2,475-year PGA falls from 0.41 to 0.31 g,'
    >>> said[132:]
    ' and with the others weighed by survival it is 0.29 g.'
    """
    these = "this rock" if rocks == 1 else f"these {rocks} rocks together"
    chance = f"less than {100.0 * least:g} % chance of having survived"
    if len(names) == 1:
        found = (
            f"The one curve given leaves {these} {percent(survival[0])} chance of having survived"
        )
        return f"{found}; {'it is rejected' if rejected[0] else 'it is kept'}."
    if rejected.all():
        unfit = "the model as a whole, the age and the fragility do not go together"
        return f"Every branch leaves {these} {chance}: {unfit}."
    if not rejected.any():
        worst = int(np.argmin(survival))
        found = f"No branch leaves {these} {chance}; branch {names[worst]} leaves the least, "
        moved = _moved(pga[0], pga[2])
        return f"{found}{percent(survival[worst])}. Weighed by it, the 2,475-year PGA {moved}."
    gone = [name for name, out in zip(names, rejected, strict=True) if out]
    if len(gone) > MOST_NAMED:
        subject = f"{len(gone):,} of {len(names):,} branches leave"
    else:
        subject = form(len(gone), "Branch {} leaves", "Branches {} leave").format(listed(gone))
    them = form(len(gone), "it", "them")
    falls = _moved(*pga[:2])
    dropped, after = (f"{value:.2f}" for value in pga[1:])
    if after not in (dropped, "nan"):
        falls += f", and with the others weighed by survival it is {after} g"
    return f"{subject} {these} {chance}; without {them} the 2,475-year PGA {falls}."


def _moved(before: float, after: float) -> str:
    if not np.isfinite([before, after]).all():
        return "is beyond the levels of the curves"
    shown = f"{before:.2f}", f"{after:.2f}"
    if shown[0] == shown[1]:
        return f"stays at {shown[0]} g"
    return f"{'falls' if after < before else 'rises'} from {shown[0]} to {shown[1]} g"


def of_age(age: Age) -> str:
    """An age as a page states it.

    Examples
    --------
    >>> of_age(NormalAge(kind="normal", mean=20000.0, sd=3000.0))
    '20,000 ± 3,000 years (normal, one standard deviation)'
    """
    if isinstance(age, NormalAge):
        if age.sd == 0.0:
            return f"{age.mean:,.0f} years, taken as exact"
        return f"{age.mean:,.0f} ± {age.sd:,.0f} years (normal, one standard deviation)"
    if isinstance(age, LognormalAge):
        spread = f"lognormal, standard deviation {age.log_sd:g} of its logarithm"
        return f"{age.median:,.0f} years ({spread})"
    if isinstance(age, BoundedAge):
        return f"{age.low:,.0f} to {age.high:,.0f} years, all equally likely"
    low, middle, high = np.percentile(age.values, [5, 50, 95])
    many = f"{len(age.values):,} samples, 5-95 %: {low:,.0f} to {high:,.0f}"
    return f"{middle:,.0f} years (median of {many})"


def of_place(longitude: float, latitude: float) -> str:
    """A place as a map names it.

    Parameters
    ----------
    longitude, latitude : float [degree]

    Examples
    --------
    >>> of_place(-120.86, 35.19)
    '120.86° W, 35.19° N'
    """
    east, north = "E" if longitude >= 0.0 else "W", "N" if latitude >= 0.0 else "S"
    return f"{abs(longitude):.5g}° {east}, {abs(latitude):.5g}° {north}"
