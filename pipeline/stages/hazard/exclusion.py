"""Exclusion: which earthquakes would topple a rock, and which faults it speaks against.

Nothing is simulated here, and no hazard curves are asked: a ground-motion model says what shaking
an earthquake of a magnitude brings at a distance.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.config import in_si
from pipeline.config.hazard_schema import Age, History
from pipeline.config.layers import Origin
from pipeline.config.observation_schema import Observations
from pipeline.config.paths import kept
from pipeline.config.sections import Key
from pipeline.drawing.style import svg_uri
from pipeline.stages.fragility.summary import Fits
from pipeline.stages.hazard import exclusion_figures as figures
from pipeline.stages.hazard.fault_files import Faults
from pipeline.stages.hazard.open_ends import told_of_untested
from pipeline.stages.hazard.open_scenarios import open_faults, open_magnitudes
from pipeline.stages.hazard.rock_ages import back_to
from pipeline.stages.hazard.rock_fragility import DRAWN, OTHER_ROWS, RockFragility, of_rock
from pipeline.stages.hazard.sensitivity import coarse
from pipeline.stages.mesh.products import RockData
from pipeline.stages.uncertainty.draws import EnsembleData
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import Stored, described, netcdf
from pipeline.workflow.grammar import counted, listed
from pipeline.workflow.stage import Product, Work
from vsr_core.arrays import Array, Mask
from vsr_core.hazard import scenarios
from vsr_core.hazard.scenarios import DISTANCES, MAGNITUDES, Shaking, nearest, toppling_chance
from vsr_core.hazard.shaking import REACH

FILE, TABLE, FAULTS, PAGE = (
    "exclusion.nc",
    "exclusion.csv",
    "exclusion_faults.csv",
    "exclusion.html",
)

STANDING = (0.05, 0.5, 0.95)
"""Chances of standing at which the least distance of an earthquake is given."""

_STEP, _FACTOR = 0.1, 1.1
"""Step of magnitude, and factor between distances, of the map."""

_SHOWN = np.arange(3.0, 10.5, 0.5)
"""Magnitudes in the table of the page, those nearest to them that the map has."""


class ExclusionData(Stored):
    """Which earthquakes would topple the rock."""

    FILE = FILE


def make(
    work: Work,
    age: Annotated[Age | None, Key("hazard.age")],
    history: Annotated[History, Key("hazard.history")],
    minimum: Annotated[float, Key("hazard.minimum_survival_probability")],
    support: Annotated[str, Key("hazard.support")],
    faults: Faults,
    rock: RockData,
    fits: Fits,
    ensemble: EnsembleData | None,
    observed: Annotated[Observations, Key("observations")],
) -> Product:
    """Map the earthquakes that topple a rock, and weigh faults by its survival.

    Returns
    -------
    Product
        ``exclusion.nc``, ``exclusion.csv``, ``exclusion_faults.csv`` and ``exclusion.html``.
    """
    drawn = ensemble is not None and support == "tested"
    own = of_rock(rock, fits, ensemble if drawn else None)
    found = _map(own, faults)
    not_known = [
        *open_magnitudes(own, *_nearest_standing(found, faults)),
        *_untested_magnitudes(found, _map(own.within_tested(), faults), own.tested[1]),
        *_frequent(faults),
    ]
    if faults.faults:
        assert age is not None
        seen = observed if drawn else ()
        ages = back_to(age, history, seen)[:, 0]  # for which it stood as now
        found = found.merge(of_faults(own, faults, ages))
        not_known += _open(own, faults, ages, found, work.origin)
        not_known += too_coarse(own, faults, ages, found, minimum)
        found["fault_rejected"] = (found["fault_survival"] < minimum).astype(np.int8)
    for told in not_known:
        work.log(f"exclusion: {told}")
    known = rock.data.attrs
    page = {
        "exclusion": facts(found, minimum, own),
        "site": work.origin.name,
        "origin": {"source": known["shape_source"], "surrogate": known["surrogate"]},
        "files": [kept(path) for path in faults.files],
        "not_known": not_known,
    }
    files = {
        FILE: netcdf(described(found, work, "Exclusion")),
        TABLE: writers.table(_distances(found)),
        FAULTS: writers.table(_table(found)),
        PAGE: writers.text(pages.filled(PAGE, page, work.up)),
    }
    return Product(files, _summary(found))


def _chances(rock: RockFragility, shaking: Shaking) -> Array:
    """Chance of toppling of each draw, or of the fits and their ends, shape (n, earthquakes)."""
    low, high = in_si.acceleration(np.array(rock.tested)) * np.array([1.0 / REACH, REACH])
    rows = [*rock.others] if rock.source == DRAWN else [rock.mean, *rock.others]
    return toppling_chance(shaking, rock.ratios, rows, scenarios.parts_between(low, high))


def _summed(rock: RockFragility, values: Array) -> tuple[Array, Array, Array]:
    """Mean of draws with 5 and 95 % of them, or the fits with the ends of their intervals."""
    if rock.source == DRAWN:
        low, high = np.percentile(values, [5.0, 95.0], axis=0)
        return values.mean(axis=0), low, high
    return values[0], values.min(axis=0), values.max(axis=0)


def _shaking(faults: Faults, magnitudes: Array, distances: Array) -> Shaking:
    if faults.model is not None:
        return faults.model.at(magnitudes, distances)
    return scenarios.of_equations(magnitudes, distances)


def _spans(faults: Faults) -> tuple[tuple[float, float], tuple[float, float]]:
    """Least and largest magnitude, and distance [km], that the shaking is known of."""
    model = faults.model
    one, other = (model.magnitudes, model.distances) if model else (MAGNITUDES, DISTANCES)
    return (one[0], one[-1]), (other[0], other[-1])


def _of_all(faults: Faults) -> Shaking:
    """Shaking by an earthquake of each fault."""
    magnitudes, distances = (
        np.array([getattr(one, name) for one in faults.faults])
        for name in ("magnitude", "distance_km")
    )
    return _shaking(faults, magnitudes, distances)


def _nearest_standing(found: xr.Dataset, faults: Faults) -> tuple[Shaking, Array]:
    """Shaking at the least distances of a map, within it, and their magnitudes."""
    least = found["least_distance"].values
    near, far = found["distance"].values[[0, -1]]
    magnitudes = np.repeat(found["magnitude"].values, least.shape[1])
    return _shaking(faults, magnitudes, np.clip(least.ravel(), near, far)), magnitudes


def _frequent(faults: Faults) -> Iterator[str]:
    """Faults with more earthquakes than few have, in words."""
    for one in faults.faults:
        if one.is_frequent:
            often = f"M {one.magnitude:g} of {one.name} comes {one.rate_per_year:g} times a year"
            yield f"{often}, as of few faults: is it in thousands of years?"


def _untested_magnitudes(found: xr.Dataset, within: xr.Dataset, tested: float) -> Iterator[str]:
    """Magnitudes whose least distances rest on a PGA [g] that was not tried, in words.

    Parameters
    ----------
    within : the map if nothing more toppled beyond it
    """
    one, other = (np.maximum(data["least_distance"].values, _NEAR) for data in (found, within))
    with np.errstate(invalid="ignore"):
        off = (one != other) & ~(np.abs(np.log(one / other)) < np.log(_FACTOR))
    if len(magnitudes := found["magnitude"].values[off.any(axis=1)]):
        span = " to ".join(f"{at:.1f}" for at in sorted({magnitudes.min(), magnitudes.max()}))
        why = f"no runs are above {tested:.3g} g, where its fits take the rock to topple"
        yield f"least distances of M {span} may be too large: {why}"


_NEAR = 0.1
"""Distance [km] in place of none."""


def _beyond(faults: Faults, magnitudes: Array, distances: Array) -> Mask:
    """Of which earthquakes the shaking is not known; nearest to a fault the equations hold."""
    (weak, strong), (near, far) = _spans(faults)
    near = near if faults.model else 0.0
    outside = (magnitudes < weak) | (magnitudes > strong) | (distances < near) | (distances > far)
    return np.asarray(outside)


def _map(rock: RockFragility, faults: Faults) -> xr.Dataset:
    """Chance of toppling by magnitude and distance, and how near it still stands."""
    (weak, strong), (near, far) = _spans(faults)
    magnitudes = np.linspace(weak, strong, max(1 + round((strong - weak) / _STEP), 2))
    distances = np.geomspace(near, far, 2 + int(np.log(far / near) / np.log(_FACTOR)))
    shape = len(magnitudes), len(distances)
    every = np.repeat(magnitudes, shape[1]), np.tile(distances, shape[0])
    chances = _chances(rock, _shaking(faults, *every))
    mean, low, high = (part.reshape(shape) for part in _summed(rock, chances))
    axes = ("magnitude", "distance")
    least = np.stack([nearest(distances, mean, chance) for chance in STANDING], axis=1)
    return xr.Dataset(
        {
            "scenario_toppling_probability": (axes, mean),
            "scenario_toppling_probability_low": (axes, low),
            "scenario_toppling_probability_high": (axes, high),
            "least_distance": (("magnitude", "standing_probability"), least),
        },
        {"magnitude": magnitudes, "distance": distances, "standing_probability": list(STANDING)},
        {"ground_motion": "equations" if faults.model is None else "table"},
    )


def of_faults(rock: RockFragility, faults: Faults, ages: Array) -> xr.Dataset:
    """Survival of the rock under each fault alone, all kinds of its earthquakes, and under all."""
    given = faults.faults
    names, of = np.unique([one.name for one in given], return_inverse=True)
    magnitudes, distances, rates = (
        np.array([getattr(one, name) for one in given])
        for name in ("magnitude", "distance_km", "rate_per_year")
    )
    chances = _chances(rock, _of_all(faults))
    each = [
        scenarios.survival(chances[:, of == i], rates[of == i], ages) for i in range(len(names))
    ]
    alone = np.stack(each, axis=1)[:, of]
    toppled, stood = _summed(rock, chances), _summed(rock, alone)
    together = _summed(rock, scenarios.survival(chances, rates, ages))
    ends = ("", "_low", "_high")
    return xr.Dataset(
        {
            "fault_magnitude": ("fault", magnitudes),
            "fault_distance": ("fault", distances),
            "fault_rate": ("fault", rates),
            **{
                f"fault_toppling_probability{end}": ("fault", toppled[i])
                for i, end in enumerate(ends)
            },
            **{f"fault_survival{end}": ("fault", stood[i]) for i, end in enumerate(ends)},
            **{f"survival_together{end}": ((), float(together[i])) for i, end in enumerate(ends)},
            "fault_beyond": ("fault", _beyond(faults, magnitudes, distances).astype(np.int8)),
            "mechanism": ("fault", [one.mechanism for one in given]),
        },
        {"fault": [one.name for one in given]},
    )


def _open(
    rock: RockFragility, faults: Faults, ages: Array, found: xr.Dataset, origin: Origin
) -> Iterator[str]:
    """What is not known of the shaking by some faults, or of what it topples, in words."""
    names = found["fault"].values.tolist()
    often = (ages.mean() * found["fault_rate"].values).tolist()
    yield from open_faults(rock, _of_all(faults), names, often, origin)
    most = of_faults(rock.within_tested(), faults, ages)
    each = ([*_by_fault(data).items(), ("all together", data["survival_together"].item())]
            for data in (found, most))  # fmt: skip
    for (name, survival), (_, without) in zip(*each, strict=True):
        of = f"the rock under {name}"
        yield from told_of_untested(survival, without, of, rock.tested[1], origin)


def _by_fault(found: xr.Dataset, what: str = "fault_survival") -> dict[str, float]:
    """What all kinds of earthquakes of a fault have, by its name."""
    return dict(zip(found["fault"].values.tolist(), found[what].values.tolist(), strict=True))


def too_coarse(
    rock: RockFragility, faults: Faults, ages: Array, found: xr.Dataset, minimum: float
) -> Iterator[str]:
    """That verdicts on faults hang on where the PGV/PGA of the runs lie, in words."""
    placed = (of_faults(of(rock), faults, ages) for of in OTHER_ROWS.values())
    base, *others = (np.array([*_by_fault(one).values()]) < minimum for one in (found, *placed))
    if turned := int(np.any([one != base for one in others], axis=0).sum()):
        yield coarse(f"{turned} of {counted(len(base), 'fault')}")


def _distances(found: xr.Dataset) -> pd.DataFrame:
    """Least distances, a row a magnitude and chance."""
    table = found["least_distance"].to_dataframe().reset_index()
    return table.rename(columns={"least_distance": "least_distance_km"})


def _table(found: xr.Dataset) -> pd.DataFrame:
    """The faults, one a row; none where none are given."""
    names = {
        "name": "fault",
        "magnitude": "fault_magnitude",
        "distance_km": "fault_distance",
        "rate_per_year": "fault_rate",
        **{
            f"{name}{end}": f"fault_{name}{end}"
            for name in ("toppling_probability", "survival")
            for end in ("", "_low", "_high")
        },
        "rejected": "fault_rejected",
        "beyond": "fault_beyond",
    }
    if "fault" not in found.dims:
        return pd.DataFrame(columns=list(names))
    return pd.DataFrame({own: found[name].values for own, name in names.items()})


def facts(found: xr.Dataset, minimum: float, rock: RockFragility) -> dict[str, Any]:
    """What the page says of earthquakes, and the page of the hazard too."""
    of_page = found.sel(magnitude=_SHOWN, method="nearest").drop_duplicates("magnitude")
    given: dict[str, Any] = {
        "pictures": {"exclusion": svg_uri(figures.exclusion(found))},
        "magnitudes": [
            {"magnitude": float(m), "distances": row.tolist()}
            for m, row in zip(
                of_page["magnitude"].values, of_page["least_distance"].values, strict=True
            )
        ],
        "standing": list(STANDING),
        "span": (float(found["distance"][0]), float(found["distance"][-1])),
        "table": found.attrs["ground_motion"] == "table",
        "drawn": rock.source == DRAWN,
        "least": minimum,
        "faults": [],
    }
    if "fault" in found.dims:
        rows = _table(found).to_dict("records")
        mechanisms = found["mechanism"].values.tolist()
        given["faults"] = [
            row | {"mechanism": one} for row, one in zip(rows, mechanisms, strict=True)
        ]
        out = [name for name, no in _by_fault(found, "fault_rejected").items() if no]
        given["rejected"] = {
            name: listed([f"{row['magnitude']:.3g}" for row in rows if row["name"] == name])
            for name in out
        }
        given["together"] = [
            float(found[f"survival_together{end}"]) for end in ("", "_low", "_high")
        ]
    return given


def _summary(found: xr.Dataset) -> str:
    if "fault" not in found.dims:
        return f"{counted(found.sizes['magnitude'], 'magnitude')}, no faults given"
    worst = found.isel(fault=int(np.argmin(found["fault_survival"].values)))
    rejected = _by_fault(found, "fault_rejected")
    beyond = len(np.unique(found["fault"].values[found["fault_beyond"].values == 1]))
    return (
        f"{sum(rejected.values()):g} of {counted(len(rejected), 'fault')} rejected; least survival "
        f"{worst['fault_survival'].item():.3g} under {worst['fault'].item()}, "
        f"{found['survival_together'].item():.3g} under all together"
        + (f"; {beyond} beyond what the shaking is known of" if beyond else "")
    )
