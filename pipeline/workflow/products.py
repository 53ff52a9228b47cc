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
    engine : str, that it cannot be made without, whatever the site
    unresolved : what an exit code of 1 means, after 1 and after any other number
    """

    stage: str
    shown: tuple[str, ...] = ()
    unresolved: tuple[str, str] = WITHOUT_VERDICT
    engine: str = "nonsmooth"


DELIVERABLES = {
    "rock": Deliverable("rock"),
    "motions": Deliverable("motions"),
    "responses": Deliverable("responses"),
    "boundary": Deliverable("boundary", ("boundary.nc",)),
    "fragility": Deliverable("report", ("report.html", "fragility.csv", "responses.nc")),
    "study": Deliverable("fragility"),
    "report": Deliverable("report", ("report.html", "fragility.csv", "responses.nc")),
    "uncertainty": Deliverable(
        "uncertainty",
        ("uncertainty.html", "uncertainty.nc"),
        (
            "run of a draw is unresolved; uncertainty.nc says which",
            "runs of draws are unresolved; uncertainty.nc says which",
        ),
    ),
    "observations": Deliverable("observations", ("observations.html", "observations.nc")),
    "displacement": Deliverable(
        "displacement_report", ("displacement.html", "trajectories.html", "correlation.csv")
    ),
    "exclusion": Deliverable("exclusion", ("exclusion.html", "exclusion.csv", "exclusion.nc")),
    "hazard": Deliverable("hazard", ("hazard.html", "hazard.csv", "hazard.nc")),
    "accuracy": Deliverable(
        "accuracy", ("accuracy.html", "accuracy.csv", "work_precision.png"), engine="bullet"
    ),
    "stability": Deliverable(
        "stability",
        ("stability.html", "stability.csv", "stability_map.png"),
        (
            "case is silently wrong; stability.html says which",
            "cases are silently wrong; stability.html says which",
        ),
        engine="bullet",
    ),
    "drive": Deliverable("drive", ("drive.html", "drive.csv", "drive.nc"), engine="bullet"),
    "validation": Deliverable("validation", ("validation.html", "validation.csv", "validation.nc")),
}
"""By the names that ``vsr run`` takes."""

GRIDDED = ("responses", "fragility", "report", "displacement_report")
"""Stages whose products have a dimension of directions and one of frictions."""
