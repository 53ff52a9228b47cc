"""Hazard: survival of a rock under each branch of a hazard model, and the posterior model.

Nothing is simulated here: other curves, another age or another table of PGV/PGA use the runs that
are there.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

from pipeline.config.hazard_schema import HazardConfig
from pipeline.config.observation_schema import Observations
from pipeline.config.sections import Key
from pipeline.stages.fragility.summary import Fits
from pipeline.stages.hazard import sensitivity
from pipeline.stages.hazard.curve_folder import Curves
from pipeline.stages.hazard.exclusion import ExclusionData
from pipeline.stages.hazard.exclusion import facts as of_earthquakes
from pipeline.stages.hazard.hazard_dataset import SCALES, dataset, drawn_tables, pga_at, table
from pipeline.stages.hazard.hazard_page import page, strength
from pipeline.stages.hazard.one_rock import alike_in_shape
from pipeline.stages.hazard.open_ends import of_scale, open_cases, open_ends
from pipeline.stages.hazard.other_rocks import Others, dated
from pipeline.stages.hazard.rock_ages import of_age, years_observed
from pipeline.stages.hazard.rock_fragility import RockFragility, all_borders, of_rock
from pipeline.stages.hazard.shaking_ratio import of_hazard
from pipeline.stages.hazard.survival_analysis import BranchResults, DatedRock, SurvivalAnalysis
from pipeline.stages.mesh.products import RockData
from pipeline.stages.uncertainty.draws import EnsembleData
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.grammar import counted
from pipeline.workflow.stage import Product, Work

FILE, TABLE, PAGE = "hazard.nc", "hazard.csv", "hazard.html"


def make(
    work: Work,
    config: HazardConfig,
    curves: Curves,
    beside: Others,
    rock: RockData,
    fits: Fits,
    ensemble: EnsembleData | None,
    excluded: ExclusionData,
    observed: Annotated[Observations, Key("observations")],
) -> Product:
    """Reject and reweight the branches of a hazard model by a rock's survival.

    Returns
    -------
    Product
        ``hazard.nc``, ``hazard.html``, and tables of branches, curves, ages and cases.
    """
    model, name, origin = curves.model, work.origin.name, work.origin
    for unused in curves.unused:
        work.log(f"hazard: {unused}")
    drawn = ensemble is not None and config.support == "tested"
    own = of_rock(rock, fits, ensemble if drawn else None)
    seen = observed if drawn else ()
    rocks = _rocks(fits.folder, name, own, config, seen, beside)
    for alike in alike_in_shape({name: rock.data} | beside.shapes(fits.folder)):
        work.log(f"hazard: {alike}")
    compared = _compared(fits, rock, ensemble, beside, drawn=drawn)
    used = [*(stage for rock in rocks for stage in rock.stages), *compared.values()]
    borders = all_borders(used)
    assumed = of_hazard(config, model, curves.events, curves.disaggregated, borders)
    minimum, of_pgv = config.minimum_survival_probability, assumed.source == "curves"
    analysis = SurvivalAnalysis(model, rocks, assumed.shaking, minimum)
    work.log(f"hazard: {strength(analysis.before)}")
    by_member = analysis.survival_of_others()
    all_cases = sensitivity.cases(analysis, assumed.alternatives, compared)
    results = all_cases[0].results
    found = dataset(analysis, results, by_member, all_cases)
    beyond = open_ends(analysis, results, origin, of_pgv=of_pgv)
    scale, late = of_scale(analysis, found["scale_factor"].item(), of_pgv=of_pgv)
    if math.isnan(scale):
        found = found.assign(dict.fromkeys(SCALES, scale))
    of_others = open_cases(all_cases, compared, beyond, origin)
    not_known = (*beyond, *late, *of_others, *sensitivity.too_coarse(all_cases))
    for one in (*beside.slips(), *not_known):
        work.log(f"hazard: {one}")
    facts = page(name, config, rock, analysis, assumed, found, curves)
    facts |= _of_rocks(name, config, seen, beside) | {"not_known": not_known}
    facts["exclusion"] = of_earthquakes(excluded.data, minimum, own)
    files = {
        FILE: netcdf(described(found, work, "Hazard")),
        TABLE: writers.table(table(found)),
        **{name: writers.table(one) for name, one in drawn_tables(found).items()},
        PAGE: writers.text(pages.filled(PAGE, facts, work.up)),
    }
    return Product(files, _summary(analysis, results))


def _rocks(
    folder: Path,
    name: str,
    own: RockFragility,
    config: HazardConfig,
    seen: Observations,
    beside: Others,
) -> tuple[DatedRock, ...]:
    """The rock and those beside it, with their ages and stages."""
    assert config.age is not None
    rocks = [dated(folder, name, own, config.age, config.history, seen, beside.earlier)]
    for other, given in zip(beside.rocks, config.rocks, strict=True):
        now, known = other.fragility(folder), (other.history, other.observed, other.earlier)
        rocks.append(dated(folder, other.name, now, given.age, *known))
    return tuple(rocks)


def _compared(
    fits: Fits, rock: RockData, ensemble: EnsembleData | None, beside: Others, *, drawn: bool
) -> dict[str, RockFragility]:
    """The rock's other fragilities, by the names of their cases."""
    compared = {}
    if ensemble is not None:  # beside which settings are compared
        name = sensitivity.AS_GIVEN if drawn else sensitivity.AS_TESTED
        compared[name] = of_rock(rock, fits, None if drawn else ensemble)
    for other in beside.compared:
        what = f"{sensitivity.AS_GIVEN}, {other.name}" if drawn else other.name
        compared[what] = other.fragility(fits.folder)
    return compared


def _of_rocks(
    name: str, config: HazardConfig, seen: Observations, beside: Others
) -> dict[str, Any]:
    """What the page tells of stages, and of years that observations count once."""
    others = [*beside.earlier, *(o for one in beside.rocks for o in (one, *one.earlier))]
    return {
        "earthquakes": sum(map(years_observed, [seen, *(one.observed for one in others)])),
        "history": [
            {"rock": of, "name": Path(one.site).stem, "until": of_age(one.until), "age": one.until}
            for of, stages in ((name, config.history), *((o.name, o.history) for o in beside.rocks))
            for one in stages
        ],
    }


def _summary(analysis: SurvivalAnalysis, results: BranchResults) -> str:
    rejected, branches = int(results.rejected.sum()), len(analysis.model.branches)
    before, after = (
        "none" if math.isnan(pga) else f"{pga:.3g} g"
        for pga in (pga_at(one, 2475.0) for one in (analysis.before, results.after))
    )
    return (
        f"{rejected} of {counted(branches, 'branch', 'branches')} rejected; "
        f"2,475-year PGA: prior {before}, posterior {after}"
    )
