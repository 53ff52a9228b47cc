"""What a user can ask for: names of products, the stage that ends each, options and files of it."""

from __future__ import annotations

from dataclasses import dataclass

_WHERE = "unresolved; the report and responses.nc say which"
WITHOUT_VERDICT = (f"run is {_WHERE}", f"runs are {_WHERE}")
_DRAWN = "unresolved; the report and responses.nc, or of draws uncertainty.nc, say which"
_RUN_OR_DRAWN = (f"run is {_DRAWN}", f"runs are {_DRAWN}")

OF_A_SITE = ("site", "name", "study", "set")
"""Options that name a rock and its settings."""

_ROCK, _TERRAIN = "--site double_rock", "--site double_rock_terrain"


@dataclass(frozen=True)
class Deliverable:
    """A product as it is asked for on the command line.

    Attributes
    ----------
    stage : str, the stage that ends it: fragility and displacement come with their reports
    about : str, what it tells
    example : str, options with which it can be made
    options : those it takes, beside where its runs are done
    engine : str, that it cannot be made without, whatever the site
    unresolved : what an exit code of 1 means, after 1 and after any other number
    """

    stage: str
    about: str
    example: str
    shown: tuple[str, ...] = ()
    unresolved: tuple[str, str] = WITHOUT_VERDICT
    engine: str = "nonsmooth"
    options: tuple[str, ...] = OF_A_SITE


DELIVERABLES = {
    "rock": Deliverable("rock", "mass, inertia, base and tipping angles of the rock", _ROCK),
    "motions": Deliverable("motions", "the ground motions, and what they ask of a table", _ROCK),
    "responses": Deliverable("responses", "the outcome of every run of the grid", _ROCK),
    "boundary": Deliverable(
        "boundary", "every change of outcome along PGA, resolved", _ROCK, ("boundary.nc",)
    ),
    "fragility": Deliverable(
        "report",
        "how strong shaking must be to topple the rock",
        f"{_ROCK} --set 'yaw=[0,90]'",
        ("report.html", "fragility.csv", "responses.nc"),
    ),
    "study": Deliverable(
        "fragility",
        "the boundary for each value of a swept setting; needs --study",
        f"{_ROCK} --study friction",
    ),
    "report": Deliverable(
        "report", "the same as fragility", _ROCK, ("report.html", "fragility.csv", "responses.nc")
    ),
    "uncertainty": Deliverable(
        "uncertainty",
        "how certain the boundary is, and what decides it",
        _ROCK,
        ("uncertainty.html", "uncertainty.nc"),
        (
            "run of a draw is unresolved; uncertainty.nc says which",
            "runs of draws are unresolved; uncertainty.nc says which",
        ),
    ),
    "observations": Deliverable(
        "observations",
        "what tests of the rock in the field teach",
        "--site my_rock.yaml",
        ("observations.html", "observations.nc"),
    ),
    "displacement": Deliverable(
        "displacement_report",
        "where the rock goes that left its seat",
        _TERRAIN,
        ("displacement.html", "trajectories.html", "correlation.csv"),
    ),
    "geodata": Deliverable(
        "geodata",
        "end positions and paths for a map; needs georeference.crs",
        f"{_TERRAIN} --set georeference.crs=EPSG:32611",
        ("displacement.gpkg", "end_positions.geojson", "trajectories.geojson"),
    ),
    "model": Deliverable(
        "model", "terrain, rock and end positions for a 3D viewer", _TERRAIN, ("model.glb",)
    ),
    "exclusion": Deliverable(
        "exclusion",
        "which earthquakes and faults the rock speaks against; of faults by its --age",
        f"{_ROCK} --age 20000 --age-sd 3000",
        ("exclusion.html", "exclusion.csv", "exclusion.nc"),
        _RUN_OR_DRAWN,
        options=(*OF_A_SITE, "age", "age-sd"),
    ),
    "hazard": Deliverable(
        "hazard",
        "what the rock says of a hazard model; needs --curves, or --events, and --age",
        f"{_ROCK} --curves data/raw/hazard/made_up --age 2000",
        ("hazard.html", "hazard.csv", "hazard.nc"),
        _RUN_OR_DRAWN,
        options=(*OF_A_SITE, "curves", "events", "age", "age-sd"),
    ),
    "accuracy": Deliverable(
        "accuracy",
        "error against run time, here and elsewhere",
        _ROCK,
        ("accuracy.html", "accuracy.csv", "work_precision.png"),
        engine="bullet",
    ),
    "stability": Deliverable(
        "stability",
        "stiff and extreme cases, each with its verdict",
        "--site cuboid_1x1x2",
        ("stability.html", "stability.csv", "stability_map.png"),
        (
            "case is silently wrong; stability.html says which",
            "cases are silently wrong; stability.html says which",
        ),
        engine="bullet",
    ),
    "drive": Deliverable(
        "drive",
        "what a servo makes of the motions",
        "--site cuboid_1x1x2",
        ("drive.html", "drive.csv", "drive.nc"),
        engine="bullet",
    ),
    "validation": Deliverable(
        "validation",
        "predictions of shake-table tests; needs --table",
        "--table data/raw/double_rock_prints",
        ("validation.html", "validation.csv", "validation.nc"),
        options=("table", "name"),
    ),
}
"""By the names that ``vsr run`` takes."""

GRIDDED = ("responses", "fragility", "report", "displacement_report")
"""Stages whose products have a dimension of directions and one of frictions."""
