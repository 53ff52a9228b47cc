"""Observations: draws of a rock weighed by what was observed, and what a further test would teach.

Nothing of the study is run here. The ensemble of ``uncertainty`` takes its rocks from the draws
that are left.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import xarray as xr

from pipeline.config.observation_schema import Observations
from pipeline.config.priors_schema import UncertaintyConfig
from pipeline.config.sections import Key
from pipeline.drawing.style import pictures, png_uri
from pipeline.stages.mesh.products import RockData, ScanData
from pipeline.stages.observations import evidence
from pipeline.stages.observations import observations_page as page
from pipeline.stages.observations.evidence import Evidence
from pipeline.stages.observations.shaking import ShakenBy
from pipeline.stages.runs.scenes import Group
from pipeline.stages.runs.study import Study
from pipeline.stages.uncertainty import draws as drawing
from pipeline.stages.uncertainty.draws import Draw, Observed, Replica
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.progress import Steps
from pipeline.workflow.stage import Product, Work
from vsr_core.arrays import Array
from vsr_core.observations import weighing
from vsr_core.validation.conditioning import effective_number

PAGE = "observations.html"

DIRECTIONS = np.arange(0.0, 360.0, 30.0)
"""In which the band is told, and a further tilt test is thought of [degree]."""

FIRST, MOST = 256, 2048
"""Draws that are weighed, and at most where few of them are left; of seats an eighth of them."""

ENOUGH = 2.0
"""Effective number of draws for a member of the ensemble with which no more are drawn."""

HOPELESS = 4.0 * weighing.LEAST
"""Logarithm of a likelihood below which more draws are not waited for."""

TEST_SD = 0.5
"""Error of a tilt test that is thought of [degree]."""

UNKNOWNS = (
    "centre of mass along the direction",
    "height of the centre of mass",
    "inset of the base",
    "shape of the base, and change of edge",
)
"""What decides the static tipping; the last is what the others leave over."""


def make(
    work: Work,
    study: Study,
    rock: RockData,
    scan: ScanData | None,
    replica: Replica | None,
    shaken: ShakenBy | None,
    config: UncertaintyConfig,
    density: Annotated[float, Key("rock.density")],
    observed: Annotated[Observations, Key("observations")],
) -> Product:
    """Weigh draws by what was observed.

    Raises
    ------
    InputError
        For observations that no draw explains.
    """
    shape = drawing.surface(rock, config.scan, replica)
    settings = study.how(Group(study.yaw[0], study.settings.contact.friction[0]))
    draws: list[Draw] = []
    file = work.origin.file_of("observations")
    told = shaken.read(work.log) if shaken else {}
    number, most = (FIRST // 8, MOST // 8) if scan else (FIRST, MOST)
    with Steps("observations", work.log) as steps:
        while True:
            steps.tell(f"drawing {number} rocks")
            more = range(len(draws), number)
            draws += drawing.draws(study, config, density, shape, scan, work.origin, more)
            found = evidence.of_observations(draws, observed, shaken, settings, steps.tell)
            weight = weighing.weights(np.array([one.log_likelihood for one in found]))
            evidence.refuse(observed, found, file, HOPELESS)
            few = effective_number(weight) < ENOUGH * config.members
            if not few or number >= most:
                break
            number *= 2
        evidence.refuse(observed, found, file, weighing.LEAST)
        steps.tell("what a further test would teach")
        dataset = _dataset(draws, found, weight, config.members)
    dataset["observation"] = [one.words for one in observed]
    dataset["repairs"] = "observation", [told.get(number, "") for number in range(len(observed))]
    dataset = described(dataset, work, "Observations of the rock")
    drawn = {
        "observations_band": page.band(dataset),
        "observations_shares": page.shares(dataset),
        "observations_next": page.further(dataset),
    }
    uris = {name: png_uri(figure) for name, figure in drawn.items()}
    facts = page.facts(work.origin.name, dataset, found, uris)
    files = {Observed.FILE: netcdf(dataset), PAGE: writers.text(pages.filled(PAGE, facts, work.up))}
    for name, figure in drawn.items():
        files |= pictures(name, figure)
    return Product(files, page.summary(dataset))


def _dataset(
    draws: Sequence[Draw], found: Sequence[Evidence], weight: Array, members: int
) -> xr.Dataset:
    """Draws with their weights, and bands and shares before and after."""
    angles = np.radians(DIRECTIONS)
    tipping = np.array([draw.slopes(angles) for draw in draws])
    alike = np.full(len(draws), 1.0 / len(draws))
    both = (alike, weight)
    ln_tipping, degrees = np.log(tipping), np.degrees(np.arctan(tipping))
    own = [draw.member for draw in draws]
    centre = np.array([member.centre for member in own])
    inset = np.array([member.inset for member in own])
    shares = [
        [
            weighing.shares(ln_tipping[:, at], _unknowns(centre, inset, angle), one)
            for at, angle in enumerate(angles.tolist())
        ]
        for one in both
    ]
    wanted = weighing.expected_widths(ln_tipping, degrees, weight, TEST_SD)
    likely = np.array([one.log_likelihood for one in found])
    alone = [effective_number(weighing.left(one)) for one in likely]
    return xr.Dataset(
        {
            "draw_weight": ("draw", weight),
            "draw_tipping_pga": (("draw", "direction"), tipping),
            "log_likelihood": (("observation", "draw"), likely),
            "alone_effective": ("observation", alone),
            "drawn_friction": ("draw", [member.friction for member in own]),
            "drawn_inset": ("draw", inset),
            "drawn_centre": (("draw", "xyz"), centre),
            "taken": ("member", weighing.resampled(weight, members)),
            "tipping_band": (
                ("knowledge", "quantile", "direction"),
                [weighing.quantiles(tipping, one) for one in both],
            ),
            "tipping_share": (("knowledge", "direction", "unknown"), shares),
            "expected_width": (("test_direction", "direction"), wanted),
            "width": (
                ("knowledge", "direction"),
                [weighing.width(ln_tipping, one) for one in both],
            ),
        },
        {
            "draw": np.arange(len(draws)),
            "direction": DIRECTIONS,
            "test_direction": DIRECTIONS,
            "quantile": list(weighing.BAND),
            "knowledge": ["prior", "posterior"],
            "unknown": list(UNKNOWNS),
        },
        {"effective_number": effective_number(weight), "test_sd_degree": TEST_SD},
    )


def _unknowns(centre: Array, inset: Array, direction: float) -> Array:
    along = np.cos(direction) * centre[:, 0] + np.sin(direction) * centre[:, 1]
    return np.column_stack([along, centre[:, 2], inset])
