"""All stages, in the order of the mission: from a scan to fragility, displacement and studies.

A stage is declared here and written in its room under ``pipeline/stages``. Functions are named by
their paths, so that nothing is imported before it is needed.
"""

from __future__ import annotations

from pathlib import Path

from pipeline import ROOT
from pipeline.workflow.code_roots import (
    ENGINE_CODE,
    ENGINES,
    MOTION_CODE,
    RUN_CODE,
    TERRAIN_CODE,
    VALIDATION_CODE,
)
from pipeline.workflow.stage import Stage

SCENE_SCRIPTS = tuple(
    f"{part}.js" for part in ("geometry", "samples", "drawing", "controls", "playing")
)
"""What every page that plays a run in three dimensions is made of."""


def _modules(room: str) -> list[str]:
    """Modules of a room of ``vsr_core.verification`` that are found by their names."""
    folder: Path = ROOT / "vsr_core" / "verification" / room
    return sorted(path.stem for path in folder.glob("[!_]*.py"))


MUJOCO = "vsr_core.engines.mujoco:build"

STAGES: tuple[Stage, ...] = (
    Stage(
        "scan",
        make="pipeline.stages.mesh.scan:make",
        applies="on_terrain",
        reads=("rock", "pedestal"),
        code=("pipeline.stages.mesh.sources:load", "vsr_core.surrogates.raw_scan:scan"),
        inputs="pipeline.stages.mesh.sources:digests",
        files=("prep.html", "refused.html"),
        versions=("trimesh", "scipy"),
    ),
    Stage(
        "closed_rock",
        make="pipeline.stages.mesh.closed_rock:make",
        applies="rock_alone",
        reads=("rock",),
        code=("pipeline.stages.mesh.sources:load", "vsr_core.surrogates.double_rock:double_rock"),
        inputs="pipeline.stages.mesh.sources:digests",
        files=("closed_rock.html", "refused.html"),
        versions=("trimesh", "scipy"),
    ),
    Stage(
        "rock",
        make="pipeline.stages.mesh.rock:make",
        aside=True,
        needs=("scan",),
        reads=("rock", "pedestal", "contact.rolling_friction"),
        code=("pipeline.stages.mesh.sources:load", "vsr_core.surrogates.double_rock:double_rock"),
        inputs="pipeline.stages.mesh.sources:digests",
        versions=("trimesh", "scipy"),
    ),
    Stage(
        "time_step",
        make="pipeline.stages.runs.step_choice:make",
        needs=("rock",),
        reads=("pedestal", "contact", "drive", "servo", "simulation"),
        code=(*RUN_CODE, "pipeline.stages.runs.step_choice:measure_rows", *ENGINE_CODE),
        inputs="pipeline.stages.runs.scenes:engine_version",
        ready="pipeline.stages.runs.step_choice:load_engine",
    ),
    Stage(
        "terrain",
        make="pipeline.stages.mesh.terrain:make",
        applies="on_terrain",
        needs=("scan", "rock"),
        reads=("pedestal", "contact", "simulation.engine", "simulation.reduce"),
        code=ENGINE_CODE,
        inputs="pipeline.stages.runs.scenes:engine_version",
    ),
    Stage(
        "motions",
        make="pipeline.stages.motions.motions:make",
        reads=("motion",),
        inputs="pipeline.stages.motions.motions:inputs",
        versions=("scipy",),
    ),
    Stage(
        "runs",
        make="pipeline.stages.runs.overturning_runs:make",
        needs=("rock", "terrain", "time_step", "motions"),
        reads=("pedestal", "contact", "motion", "yaw", "drive", "servo", "simulation"),
        code=(
            *TERRAIN_CODE,
            "pipeline.stages.runs.overturning_runs:simulate_batch",
            "pipeline.stages.runs.overturning_runs:respond_batch",
            *MOTION_CODE,
            *ENGINE_CODE,
        ),
        made_elsewhere=True,
        inputs="pipeline.stages.runs.scenes:engine_version",
        check="pipeline.stages.runs.runner:database_is_there",
    ),
    Stage(
        "displacement_runs",
        make="pipeline.stages.runs.displacement_runs:make",
        needs=("rock", "terrain", "time_step", "motions"),
        reads=("pedestal", "contact", "motion", "yaw", "drive", "simulation"),
        code=(
            *TERRAIN_CODE,
            "pipeline.stages.runs.displacement_runs:follow_batch",
            *MOTION_CODE,
            *ENGINE_CODE,
        ),
        made_elsewhere=True,
        inputs="pipeline.stages.runs.displacement_runs:inputs",
        check="pipeline.stages.runs.runner:database_is_there",
    ),
    Stage(
        "responses",
        make="pipeline.stages.datasets.responses:make",
        needs=("rock", "motions", "time_step", "runs"),
        reads=("contact", "motion", "yaw", "drive", "servo", "simulation"),
    ),
    Stage(
        "bullet_sample",
        make="pipeline.stages.datasets.bullet_sample:make",
        applies="second_engine",
        needs=("rock", "terrain", "time_step", "motions", "responses"),
        reads=("pedestal", "contact", "motion", "yaw", "drive", "simulation"),
        code=(*TERRAIN_CODE, *MOTION_CODE, "vsr_core.engines.bullet:build", MUJOCO),
        aside=True,
        workers="long_runs",
        versions=("pybullet", "mujoco"),
    ),
    Stage(
        "fragility",
        make="pipeline.stages.fragility.fragility_fits:make",
        needs=("responses",),
        versions=("scipy",),
    ),
    Stage(
        "uncertainty",
        make="pipeline.stages.uncertainty.uncertainty:make",
        applies="uncertain",
        needs=("rock", "time_step", "motions", "responses"),
        reads=(
            "rock.density",
            "pedestal",
            "contact",
            "motion",
            "yaw",
            "drive",
            "servo",
            "simulation",
            "uncertainty",
        ),
        code=(
            *RUN_CODE,
            "pipeline.stages.uncertainty.ensemble:simulate_draw",
            *MOTION_CODE,
            *ENGINE_CODE,
        ),
        inputs="pipeline.stages.uncertainty.draws:inputs",
        files=("uncertainty.html", "catalogue.yaml"),
        versions=("scikit-learn", "scipy", "trimesh", "matplotlib", "jinja2"),
    ),
    Stage(
        "hazard",
        make="pipeline.stages.hazard.hazard:make",
        needs=("rock", "fragility", "uncertainty"),
        reads=("hazard", "uncertainty.members"),
        inputs="pipeline.stages.hazard.hazard:inputs",
        check="pipeline.stages.hazard.others:changed",
        files=("hazard.html",),
        versions=("scipy", "matplotlib", "jinja2"),
    ),
    Stage(
        "report",
        make="pipeline.stages.reports.report:make",
        needs=(
            "rock",
            "terrain",
            "time_step",
            "motions",
            "responses",
            "bullet_sample",
            "fragility",
        ),
        late=("bullet_sample",),
        reads=("rock", "pedestal", "contact", "motion", "yaw", "drive", "servo", "simulation"),
        code=(*TERRAIN_CODE, *MOTION_CODE, *ENGINE_CODE),
        files=(
            "report.html",
            *SCENE_SCRIPTS,
            "stage.js",
            "cells.js",
            "reduction_gains.yaml",
            "catalogue.yaml",
        ),
        versions=("matplotlib", "jinja2"),
    ),
    Stage(
        "displacement",
        make="pipeline.stages.datasets.displacement_dataset:make",
        needs=("rock", "terrain", "time_step", "motions", "displacement_runs"),
        reads=("contact", "motion", "yaw", "drive", "simulation"),
    ),
    Stage(
        "displacement_report",
        make="pipeline.stages.displacement.displacement_report:make",
        needs=("rock", "terrain", "displacement", "time_step"),
        reads=("observed_boulder", "motion", "simulation"),
        files=(
            "displacement.html",
            "scene3d.html",
            *SCENE_SCRIPTS,
            "page.js",
            "catalogue.yaml",
        ),
        versions=("matplotlib", "jinja2", "pillow"),
    ),
    Stage(
        "accuracy",
        make="pipeline.stages.studies.accuracy.accuracy:make",
        needs=("rock", "time_step"),
        reads=("pedestal", "contact", "motion", "yaw", "drive", "servo", "simulation"),
        code=(
            *RUN_CODE,
            "pipeline.stages.studies.accuracy.worker_tasks:find_target",
            "pipeline.stages.studies.accuracy.worker_tasks:score",
            "pipeline.stages.studies.accuracy.worker_tasks:run_cells",
            "pipeline.stages.studies.accuracy.worker_tasks:run_reference",
            *ENGINE_CODE,
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
        make="pipeline.stages.studies.stability.stability:make",
        code=(
            "pipeline.stages.studies.stability.stability:run_cases",
            "vsr_core.verification.stability:cases",
            *(f"vsr_core.verification.stability.{name}:CASES" for name in _modules("stability")),
            *(
                f"{engine}:{name}"
                for engine in ENGINES
                for name in ("build", "SOLVER", "SLENDER_SHARE", "SLIDING_SHARE")
            ),
        ),
        files=("stability.html",),
        versions=("pybullet", "mujoco", "scipy", "trimesh", "matplotlib", "jinja2"),
    ),
    Stage(
        "drive",
        make="pipeline.stages.studies.servo.drive:make",
        needs=("rock",),
        reads=("pedestal", "contact", "motion", "yaw"),
        code=(
            "pipeline.stages.studies.servo.drive_runs:run_rows",
            "vsr_core.engines.bullet:build",
            "vsr_core.engines.bullet:SOLVER",
        ),
        inputs="pipeline.stages.studies.servo.drive:inputs",
        files=("drive.html",),
        versions=("pybullet", "matplotlib", "jinja2"),
    ),
    Stage(
        "as_printed",
        make="pipeline.stages.studies.printed.as_printed:make",
        needs=("rock",),
        reads=("pedestal", "contact", "motion"),
        code=("pipeline.stages.studies.printed.as_printed:run_cells",),
        versions=("pybullet",),
    ),
    Stage(
        "validation",
        make="pipeline.stages.studies.validation.validation:make",
        code=VALIDATION_CODE,
        inputs="pipeline.stages.studies.validation.validation:inputs",
        files=("validation.html",),
        versions=("scikit-learn", "scipy"),
    ),
)

BY_NAME = {stage.name: stage for stage in STAGES}


def upstream(name: str) -> tuple[Stage, ...]:
    """The stages that a product needs, itself last, in the order of the mission."""
    wanted = {name}
    for stage in reversed(STAGES):
        if stage.name in wanted:
            wanted.update(stage.needs)
    return tuple(stage for stage in STAGES if stage.name in wanted)
