"""What a user can ask for: names of products, the stage that ends each, the files to look at."""

from __future__ import annotations

from dataclasses import dataclass

_WHERE = "unresolved; the report and responses.nc say which"
WITHOUT_VERDICT = (f"run is {_WHERE}", f"runs are {_WHERE}")


@dataclass(frozen=True)
class Deliverable:
    """A product as it is asked for on the command line.

    Attributes
    ----------
    stage : str, the stage that ends it: fragility and displacement come with their reports
    about : str, what it tells
    engine : str, that it cannot be made without, whatever the site
    unresolved : what an exit code of 1 means, after 1 and after any other number
    """

    stage: str
    about: str
    shown: tuple[str, ...] = ()
    unresolved: tuple[str, str] = WITHOUT_VERDICT
    engine: str = "nonsmooth"


DELIVERABLES = {
    "rock": Deliverable("rock", "mass, inertia, base and tipping angles of the rock"),
    "motions": Deliverable("motions", "the ground motions, and what they ask of a table"),
    "responses": Deliverable("responses", "the outcome of every run of the grid"),
    "boundary": Deliverable(
        "boundary", "every change of outcome along PGA, resolved", ("boundary.nc",)
    ),
    "fragility": Deliverable(
        "report",
        "how strong shaking must be to topple the rock",
        ("report.html", "fragility.csv", "responses.nc"),
    ),
    "study": Deliverable("fragility", "the same for each value of a swept setting, with --study"),
    "report": Deliverable(
        "report", "the same as fragility", ("report.html", "fragility.csv", "responses.nc")
    ),
    "uncertainty": Deliverable(
        "uncertainty",
        "how certain the boundary is, and what decides it",
        ("uncertainty.html", "uncertainty.nc"),
        (
            "run of a draw is unresolved; uncertainty.nc says which",
            "runs of draws are unresolved; uncertainty.nc says which",
        ),
    ),
    "observations": Deliverable(
        "observations",
        "what tests of the rock in the field teach",
        ("observations.html", "observations.nc"),
    ),
    "displacement": Deliverable(
        "displacement_report",
        "where the rock goes that left its seat",
        ("displacement.html", "trajectories.html", "correlation.csv"),
    ),
    "geodata": Deliverable(
        "geodata",
        "end positions and paths for a map; needs georeference.crs",
        ("displacement.gpkg", "end_positions.geojson", "trajectories.geojson"),
    ),
    "model": Deliverable(
        "model", "terrain, rock and end positions for a viewer of 3D", ("model.glb",)
    ),
    "exclusion": Deliverable(
        "exclusion",
        "which earthquakes and faults the rock speaks against; needs --age",
        ("exclusion.html", "exclusion.csv", "exclusion.nc"),
    ),
    "hazard": Deliverable(
        "hazard",
        "what the rock says of a hazard model; needs --curves and --age",
        ("hazard.html", "hazard.csv", "hazard.nc"),
    ),
    "accuracy": Deliverable(
        "accuracy",
        "error against run time, here and elsewhere",
        ("accuracy.html", "accuracy.csv", "work_precision.png"),
        engine="bullet",
    ),
    "stability": Deliverable(
        "stability",
        "stiff and extreme cases, each with its verdict",
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
        ("drive.html", "drive.csv", "drive.nc"),
        engine="bullet",
    ),
    "validation": Deliverable(
        "validation",
        "predictions of shake-table tests; needs --table",
        ("validation.html", "validation.csv", "validation.nc"),
    ),
}
"""By the names that ``vsr run`` takes."""

GRIDDED = ("responses", "fragility", "report", "displacement_report")
"""Stages whose products have a dimension of directions and one of frictions."""
