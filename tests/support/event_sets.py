"""Made-up stochastic event sets, in files as OpenQuake exports them.

`python tests/support/event_sets.py data/raw/hazard/made_up_events` writes the sample.
"""

from __future__ import annotations

import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from vsr_core import GRAVITY
from vsr_core.hazard.events import distance_of
from vsr_core.hazard.ratio import PGA, PGV

Array = NDArray[np.float64]

SITE = (-120.86, 35.19)
DEGREE = 111.195


@dataclass(frozen=True)
class EventSet:
    """What a made-up set is made of.

    Attributes
    ----------
    years : float, of each branch
    rates : dict, from the path of a branch to its weight, and earthquakes a year from M 5 on
    correlation : float, of the residuals of ln PGA and ln PGV
    """

    years: float = 20_000.0
    rates: tuple[tuple[str, float, float], ...] = (
        ("slow", 0.3, 0.03), ("middle", 0.4, 0.06), ("fast", 0.3, 0.12),
    )  # fmt: skip
    correlation: float = 0.0
    ruptures: int = 1500
    seed: int = 1

    def drawn(self) -> tuple[dict[str, Array], dict[str, Array]]:
        """Ruptures, and events in the order of their numbers: PGA in g, PGV in cm/s."""
        rng, number = np.random.default_rng(self.seed), self.ruptures
        steep = 0.9 * math.log(10.0)  # Gutenberg and Richter's, from 5 to 7.4
        share = rng.uniform(size=number) * -math.expm1(-2.4 * steep)
        magnitude = 5.0 - np.log1p(-share) / steep
        east, north = rng.uniform(-30.0, 30.0, (2, number))
        rupture = {
            "mag": magnitude,
            "centroid_lon": SITE[0] + east / DEGREE / math.cos(math.radians(SITE[1])),
            "centroid_lat": SITE[1] + north / DEGREE,
            "strike": rng.choice([140.0, 320.0], number),
            "dip": rng.choice([60.0, 90.0], number),
        }
        branch, of = [], []
        for at, (_, _, rate) in enumerate(self.rates):
            count = rng.poisson(rate * self.years / number, number)
            of.append(np.repeat(np.arange(number), count))
            branch.append(np.full(count.sum(), at))
        event = {"rup": np.concatenate(of), "rlz": np.concatenate(branch)}
        order = np.argsort(event["rup"], kind="stable")
        event = {name: values[order] for name, values in event.items()}
        first = 1 + event["rlz"] * self.years
        event["year"] = (first + rng.integers(0, int(self.years), len(order))).astype(int)
        distance = distance_of(
            magnitude, -east / DEGREE, -north / DEGREE, rupture["strike"], rupture["dip"]
        )
        own = magnitude[event["rup"]], distance[event["rup"]]
        one, other = rng.standard_normal((2, len(order)))
        other = self.correlation * one + math.sqrt(1.0 - self.correlation**2) * other
        event["pga"] = np.exp(PGA.log_median(*own) + PGA.log_sd * one) / GRAVITY
        event["pgv"] = 100.0 * np.exp(PGV.log_median(*own) + PGV.log_sd * other)
        return rupture, event

    def write(self, folder: Path) -> Path:
        """The files of a folder."""
        rupture, event = self.drawn()
        folder.mkdir(parents=True, exist_ok=True)
        told = f'"made_up=1, investigation_time=1.0, ses_per_logic_tree_path={self.years:.0f}"'
        ids = 7 + np.arange(self.ruptures)
        count = np.bincount(event["rup"], minlength=self.ruptures)
        there = count > 0  # as OpenQuake tells of no others
        table(
            folder / "ruptures_1.csv",
            told,
            "rup_id,multiplicity,mag,centroid_lon,centroid_lat,strike,dip",
            "%d,%d,%.5f,%.5f,%.5f,%.1f,%.1f",
            ids[there],
            count[there],
            *(
                rupture[name][there]
                for name in ("mag", "centroid_lon", "centroid_lat", "strike", "dip")
            ),
        )
        number = np.arange(len(event["rup"]))
        table(
            folder / "events_1.csv",
            "made_up=1",
            "event_id,rup_id,rlz_id,year,ses_id",
            "%d,%d,%d,%d,%d",
            number,
            ids[event["rup"]],
            event["rlz"],
            event["year"],
            1 + number % 100,
        )
        table(
            folder / "gmf-data_1.csv",
            "made_up=1",
            "event_id,gmv_PGA,gmv_PGV,custom_site_id",
            "%d,%.5E,%.5E,9q601y0k",
            number,
            event["pga"],
            event["pgv"],
        )
        lines = [f"{n},{name},{weight}" for n, (name, weight, _) in enumerate(self.rates)]
        lines = ["# made_up=1", "rlz_id,branch_path,weight", *lines, ""]
        (folder / "realizations_1.csv").write_text("\n".join(lines), encoding="utf-8")
        site = f"# made_up=1\ncustom_site_id,lon,lat\n9q601y0k,{SITE[0]},{SITE[1]}\n"
        (folder / "sitemesh_1.csv").write_text(site, encoding="utf-8")
        return folder

    def write_calculation(self, path: Path) -> Path:
        """The same as OpenQuake stores it; surfaces are of four corners, or of nine points."""
        rupture, event = self.drawn()
        number, own = self.ruptures, len(event["rup"])
        surfaces = [
            surface(*(float(rupture[name][at]) for name in PLACED), points=2 + at % 2)
            for at in range(number)
        ]
        columns = {"id": np.arange(own), "rup_id": 7 + event["rup"], "rlz_id": event["rlz"]}
        with h5py.File(path, "w") as file:
            file["events"] = records(columns | {"year": event["year"]})
            for name, values in (
                ("eid", columns["id"]),
                ("PGA", event["pga"]),
                ("PGV", event["pgv"]),
            ):
                file[f"gmf_data/{name}"] = values.astype("u4" if name == "eid" else "f4")
            file["gmf_data/sid"] = np.zeros(own, "u4")
            ids, count = np.arange(number), np.bincount(event["rup"], minlength=number)
            of = {"id": 7 + ids, "geom_id": ids[::-1], "mag": rupture["mag"], "n_occ": count}
            file["ruptures"] = records(of)[count > 0]  # as OpenQuake tells of no others
            file.create_dataset("rupgeoms", (number,), h5py.vlen_dtype(np.float32), chunks=True)
            for at, one in zip(of["geom_id"], surfaces, strict=True):
                file["rupgeoms"][at] = one
            file["sitecol/lon"], file["sitecol/lat"] = [SITE[0]], [SITE[1]]
            file["weights"] = np.array([weight for _, weight, _ in self.rates])
            file["full_lt/sm_data"] = np.array([(b"b",)], dtype=[("path", "S9")])
            names = [(name.encode(),) for name, _, _ in self.rates]
            file["full_lt/gsim_lt"] = np.array(names, dtype=[("branch", "S9")])
            settings = {"investigation_time": 1.0, "ses_per_logic_tree_path": int(self.years)}
            file["oqparam"] = json.dumps(settings | {"hazard_imtls": {"PGA": [0], "PGV": [0]}})
        return path


PLACED = ("centroid_lon", "centroid_lat", "strike", "dip")


def records(columns: dict[str, Array]) -> Any:
    kinds = [(name, values.dtype) for name, values in columns.items()]
    found = np.zeros(len(next(iter(columns.values()))), kinds)
    for name, values in columns.items():
        found[name] = values
    return found


def surface(lon: float, lat: float, strike: float, dip: float, points: int) -> Array:
    """Points of a rectangle of 8 km by 6 km, in rows from its upper edge; or its four corners."""
    along, down = np.meshgrid(np.linspace(-4.0, 4.0, points), np.linspace(-3.0, 3.0, points))
    sine, cosine = math.sin(math.radians(strike)), math.cos(math.radians(strike))
    across = down * math.cos(math.radians(dip))
    east, north = along * sine + across * cosine, along * cosine - across * sine
    parallel = DEGREE * math.cos(math.radians(lat))
    depth = 8.0 + down * math.sin(math.radians(dip))
    rows = (1, 4) if points == 2 else (points, points)
    places = lon + east / parallel, lat + north / DEGREE, depth
    return np.concatenate([[1.0, *rows], *(one.ravel() for one in places)])


def table(path: Path, told: str, names: str, form: str, *columns: Array) -> None:
    head = f"# {told}\n{names}"
    np.savetxt(path, np.column_stack(columns), form, header=head, comments="", encoding="utf-8")


if __name__ == "__main__":
    EventSet().write(Path(sys.argv[1]))
