"""All stages, in the order of the mission: from a scan to fragility, displacement and studies.

A stage is declared here and written in its room under ``pipeline/stages``. What it is made from is
what its function asks for (``pipeline.workflow.parameters``). Functions and classes are named by
their paths, so that nothing is imported before it is needed.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pipeline import ROOT
from pipeline.workflow import parameters
from pipeline.workflow.keys import ENGINES
from pipeline.workflow.parameters import Made, Parts, Setting
from pipeline.workflow.stage import Finder, Stage

SCENE_SCRIPTS = tuple(
    f"{part}.js" for part in ("geometry", "samples", "drawing", "controls", "playing")
)
"""What every page that plays a run in three dimensions is made of."""


def _modules(room: str) -> list[str]:
    """Modules of a room of ``vsr_core.verification`` that are found by their names."""
    folder: Path = ROOT / "vsr_core" / "verification" / room
    return sorted(path.stem for path in folder.glob("[!_]*.py"))


MUJOCO = "vsr_core.engines.mujoco:build"

INPUTS = tuple(
    Finder(f"pipeline.{module}:{find}", f"pipeline.{module}:{gives}")
    for module, find, gives in (
        ("stages.mesh.sources", "find", "Source"),
        ("stages.mesh.sources", "find_ground", "GroundFile"),
        ("stages.motions.motion_grid", "find", "MotionFiles"),
        ("workflow.engine_input", "find", "Engine"),
        ("stages.uncertainty.draws", "find_replica", "Replica"),
        ("stages.observations.shaking", "find", "ShakenBy"),
        ("stages.hazard.curve_folder", "find", "Curves"),
        ("stages.hazard.fault_files", "find", "Faults"),
        ("stages.hazard.other_rocks", "find", "Others"),
        ("stages.studies.validation.recorded_tests", "find", "Folder"),
    )
)
"""What stages read besides the configuration and each other's products."""


SOLIDS = ("trimesh", "scipy", "shapely", "fast-simplification")
"""Libraries that shape rock and ground, with ``coacd`` where a scan is cut into convex pieces."""

STAGES: tuple[Stage, ...] = (
    Stage(
        "scan",
        make="pipeline.stages.mesh.scan:make",
        gives=("pipeline.stages.mesh.products:ScanData",),
        applies=lambda site: site.on_terrain and not site.on_own_ground,
        files=("prep.html", "refused.html"),
        versions=(*SOLIDS, "coacd"),
    ),
    Stage(
        "placed",
        make="pipeline.stages.mesh.placed:make",
        gives=("pipeline.stages.mesh.products:PlacedData",),
        applies=lambda site: site.on_own_ground,
        code=("vsr_core.engines.nonsmooth:build",),
        files=("closed_rock.html", "refused.html"),
        versions=(*SOLIDS, "coacd", "numba"),
    ),
    Stage(
        "closed_rock",
        make="pipeline.stages.mesh.closed_rock:make",
        applies=lambda site: site.rock_alone,
        files=("closed_rock.html", "refused.html"),
        versions=SOLIDS,
    ),
    Stage(
        "rock",
        make="pipeline.stages.mesh.rock:make",
        gives=("pipeline.stages.mesh.products:RockData", "pipeline.stages.mesh.products:Standing"),
        aside=lambda site: True,
        versions=SOLIDS,
    ),
    Stage(
        "terrain",
        make="pipeline.stages.mesh.terrain:make",
        gives=("pipeline.stages.mesh.products:TerrainData", "pipeline.stages.mesh.products:Ground"),
        applies=lambda site: site.on_terrain,
        versions=SOLIDS,
    ),
    Stage(
        "time_step",
        make="pipeline.stages.runs.step_choice:make",
        gives=(
            "pipeline.stages.runs.step_choice:StepData",
            "pipeline.stages.runs.step_choice:TimeSteps",
        ),
        refuses="pipeline.stages.runs.scenes:refuse_step",
        bounds="pipeline.stages.runs.scenes:refuse_number",
    ),
    Stage(
        "motions",
        make="pipeline.stages.motions.motions:make",
        gives=("pipeline.stages.motions.motion_grid:MotionData",),
        versions=("scipy",),
    ),
    Stage(
        "runs",
        make="pipeline.stages.runs.overturning_runs:make",
        gives=("pipeline.stages.runs.overturning_runs:Runs",),
        in_database=True,
    ),
    Stage(
        "displacement_runs",
        make="pipeline.stages.runs.displacement_runs:make",
        gives=("pipeline.stages.runs.displacement_runs:Journeys",),
        refuses="pipeline.stages.runs.displacement_runs:refuse",
        in_database=True,
    ),
    Stage(
        "level_runs",
        make="pipeline.stages.runs.overturning_runs:make_level",
        gives=("pipeline.stages.runs.overturning_runs:LevelRuns",),
        applies=lambda site: site.with_vertical,
        in_database=True,
    ),
    Stage(
        "responses",
        make="pipeline.stages.datasets.responses:make",
        gives=("pipeline.stages.datasets.responses:Responses",),
    ),
    Stage(
        "boundary",
        make="pipeline.stages.boundary.boundary:make",
        gives=("pipeline.stages.boundary.boundary:BoundaryData",),
    ),
    Stage(
        "bullet_sample",
        make="pipeline.stages.datasets.bullet_sample:make",
        gives=("pipeline.stages.datasets.bullet_sample:BulletSample",),
        applies=lambda site: site.second_engine is not None,
        aside=lambda site: not site.long_runs,
        code=("vsr_core.engines.bullet:build", MUJOCO),
        versions=("pybullet", "mujoco"),
    ),
    Stage(
        "fragility",
        make="pipeline.stages.fragility.fragility_fits:make",
        gives=("pipeline.stages.fragility.summary:Fits",),
        versions=("scipy",),
    ),
    Stage(
        "observations",
        make="pipeline.stages.observations.observations:make",
        gives=("pipeline.stages.uncertainty.draws:Observed",),
        applies=lambda site: site.observed,
        code=("vsr_core.engines.nonsmooth:build",),
        files=("observations.html", "catalogue.yaml"),
        versions=(*SOLIDS, "matplotlib", "jinja2"),
    ),
    Stage(
        "uncertainty",
        make="pipeline.stages.uncertainty.uncertainty:make",
        gives=("pipeline.stages.uncertainty.draws:EnsembleData",),
        applies=lambda site: site.uncertain,
        refuses="pipeline.stages.uncertainty.draws:refuse_contact",
        files=("uncertainty.html", "catalogue.yaml"),
        versions=("scikit-learn", *SOLIDS, "matplotlib", "jinja2"),
    ),
    Stage(
        "exclusion",
        make="pipeline.stages.hazard.exclusion:make",
        gives=("pipeline.stages.hazard.exclusion:ExclusionData",),
        refuses="pipeline.stages.hazard.rock_ages:refuse",
        files=("exclusion.html", "earthquakes.html"),
        versions=("scipy", "matplotlib", "jinja2"),
    ),
    Stage(
        "hazard",
        make="pipeline.stages.hazard.hazard:make",
        refuses="pipeline.stages.hazard.rock_ages:refuse",
        files=("hazard.html", "earthquakes.html"),
        versions=("scipy", "matplotlib", "jinja2"),
    ),
    Stage(
        "report",
        make="pipeline.stages.reports.report:make",
        files=(
            "report.html",
            *SCENE_SCRIPTS,
            "stage.js",
            "cells.js",
            "reduction_gains.yaml",
            "catalogue.yaml",
        ),
        versions=("fast-simplification", "matplotlib", "jinja2"),
    ),
    Stage(
        "displacement",
        make="pipeline.stages.datasets.displacement_dataset:make",
        gives=("pipeline.stages.datasets.displacement_dataset:Displacement",),
    ),
    Stage(
        "displacement_report",
        make="pipeline.stages.displacement.displacement_report:make",
        files=("displacement.html", "scene3d.html", *SCENE_SCRIPTS, "page.js", "catalogue.yaml"),
        versions=("fast-simplification", "matplotlib", "jinja2", "pillow"),
    ),
    Stage(
        "geodata",
        make="pipeline.stages.displacement.geodata:make",
        refuses="pipeline.stages.displacement.geodata:refuse",
        versions=("shapely", "pyogrio", "pyproj"),
    ),
    Stage("model", make="pipeline.stages.displacement.model:make", versions=("trimesh",)),
    Stage(
        "accuracy",
        make="pipeline.stages.studies.accuracy.accuracy:make",
        code=(
            *(f"{engine}:build" for engine in ENGINES),
            *(
                f"vsr_core.verification.other_engines.{name}:build"
                for name in _modules("other_engines")
            ),
            *(f"vsr_core.verification.reference.{name}:CASES" for name in _modules("reference")),
        ),
        files=("accuracy.html",),
        versions=("pybullet", "matplotlib", "jinja2"),
    ),
    Stage(
        "stability",
        make="pipeline.stages.studies.stability:make",
        code=(
            *(f"vsr_core.verification.stability.{name}:CASES" for name in _modules("stability")),
            *(
                f"{engine}:{name}"
                for engine in ENGINES
                for name in ("build", "SOLVER", "SLENDER_SHARE", "SLIDING_SHARE")
            ),
        ),
        files=("stability.html",),
        versions=("pybullet", "mujoco", *SOLIDS, "coacd", "matplotlib", "jinja2"),
    ),
    Stage(
        "drive",
        make="pipeline.stages.studies.servo.drive:make",
        refuses="pipeline.stages.studies.servo.drive:refuse_servo",
        code=("vsr_core.engines.bullet:build", "vsr_core.engines.bullet:SOLVER"),
        files=("drive.html",),
        versions=("pybullet", "matplotlib", "jinja2"),
    ),
    Stage("as_printed", make="pipeline.stages.studies.as_printed:make", versions=("pybullet",)),
    Stage(
        "validation",
        make="pipeline.stages.studies.validation.validation:make",
        code=("vsr_core.engines.nonsmooth:build",),
        files=("validation.html",),
        versions=("scikit-learn", "scipy"),
    ),
)

ASIDE = ("feasible", "replay")
"""Commands that make products of their own from those of stages, kept by names that begin so."""

BY_NAME = {stage.name: stage for stage in STAGES}
FINDERS = {finder.gives: finder for finder in INPUTS}
MAKERS = {product: stage.name for stage in STAGES for product in stage.gives}


@cache
def asked(path: str) -> Parts:
    """What a function or class asks for."""
    return parameters.of(path, frozenset((*FINDERS, *MAKERS)))


def settings_of(path: str) -> set[str]:
    """Dotted keys of the configuration that a function reads, itself or for its inputs."""
    every = list(asked(path).each())
    for one in tuple(every):
        if isinstance(one, Made) and one.product in FINDERS:
            every += asked(FINDERS[one.product].find).each()
    return {one.key for one in every if isinstance(one, Setting)}


def inputs_of(path: str) -> list[str]:
    """Classes of the inputs that a function asks for."""
    made = (one.product for one in asked(path).each() if isinstance(one, Made))
    return sorted({product for product in made if product in FINDERS})


def needs(name: str, *, late: bool | None = None) -> tuple[str, ...]:
    """Stages whose products a stage asks for; only those, or none, that may come late."""
    wanted: dict[str, None] = {}
    for one in asked(BY_NAME[name].make).each():
        if isinstance(one, Made) and one.product in MAKERS and late in (None, one.late):
            wanted[MAKERS[one.product]] = None
    return tuple(wanted)


def upstream(name: str) -> tuple[Stage, ...]:
    """The stages that a product needs, itself last, in the order of the mission."""
    wanted = {name}
    for stage in reversed(STAGES):
        if stage.name in wanted:
            wanted.update(needs(stage.name))
    return tuple(stage for stage in STAGES if stage.name in wanted)
