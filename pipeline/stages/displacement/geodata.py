"""End positions and paths as geographic information systems read them: GeoJSON and GeoPackage."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import xarray as xr
from numpy.typing import NDArray

from pipeline.config.layers import Origin, Site
from pipeline.config.problems import InputError, Problem
from pipeline.config.scene_schema import Georeference
from pipeline.stages.datasets.displaced_runs import STOPS
from pipeline.stages.datasets.displacement_dataset import Displacement
from pipeline.stages.mesh.products import TerrainData
from pipeline.workflow.grammar import counted
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.writers import Writer
from vsr_core.arrays import Array
from vsr_core.outcome import Movement, Outcome, StopReason

PACKAGE, ENDS, PATHS = "displacement.gpkg", "end_positions.geojson", "trajectories.geojson"

WHEN = "2000-01-01T00:00:00.000Z"
"""What a GeoPackage says of its last change: the same products have the same bytes at any time."""

RFC_7946 = {"RFC7946": "YES", "COORDINATE_PRECISION": 9}
"""GeoJSON is in WGS 84, longitude first; 1e-9 degrees are a tenth of a millimetre."""

INSTALL = "install it: .venv/bin/pip install -e '.[gis]'"

Layer = tuple[NDArray[np.object_], xr.Dataset]
"""Geometries, and the runs that they are of."""


def refuse(site: Site) -> None:
    """Refuse a scan that lies nowhere, or in no coordinates that are metres."""
    key, place = "georeference", site.config.georeference
    if place is None:
        rule, remedy = "maps need to know where the scan lies", "set georeference.crs"
        raise InputError(Problem(site.file_of(key), key, "null", rule, remedy))
    try:
        import pyogrio  # noqa: F401
        from pyproj import CRS
        from pyproj.exceptions import CRSError
    except ImportError:
        problem = Problem(site.file_of(key), key, "", "maps need the extra gis", INSTALL)
        raise InputError(problem) from None
    try:
        system = CRS.from_user_input(place.crs)
        axes = system.axis_info
        metres = system.is_projected and all(a.unit_name == "metre" for a in axes)
        rule = "" if metres else f"its coordinates are metres, and those of {system.name} are not"
        if metres and {a.direction for a in axes[:2]} != {"east", "north"}:
            given = " and ".join(a.direction for a in axes[:2])
            rule = (
                f"its axes point to the east and the north, and those of {system.name} to {given}"
            )
    except CRSError:
        rule = "it is the code of a coordinate reference system"
    if rule:
        key, remedy = f"{key}.crs", "give a projected one, e.g. EPSG:32611 for UTM zone 11 north"
        raise InputError(Problem(site.file_of(key), key, repr(place.crs), rule, remedy))


def make(work: Work, runs: Displacement, ground: TerrainData, place: Georeference) -> Product:
    """Write where each run ended, and its path."""
    displacement = runs.data
    origin = np.add(place.origin, ground.data.attrs["origin_in_scan"])
    where = _where(work.origin, place.crs, origin)
    ends, paths = layers(displacement, origin, ground.data["start_position"])
    files = {
        PACKAGE: _written("GPKG", {"end_positions": ends, "trajectories": paths}, place.crs),
        ENDS: _written("GeoJSON", {"end_positions": ends}, place.crs),
        PATHS: _written("GeoJSON", {"trajectories": paths}, place.crs),
    }
    unknown = displacement.sizes["run"] - len(ends[0])
    left_out = f"; {counted(unknown, 'unresolved run')} without one" if unknown else ""
    return Product(files, f"{len(ends[0])} end positions in {place.crs}, {where}{left_out}")


BEYOND = 3.0
"""Degrees by which a place may lie outside the area of a system: half a zone of UTM."""


STRETCH = 0.01
"""By which a metre of a system may differ from one on the ground: at the edges of UTM by 0.001."""


def _where(site: Origin, crs: str, origin: Array) -> str:
    """Longitude and latitude of the rock, in words; refused where its system does not hold."""
    from pyproj import CRS, Proj, Transformer

    system = CRS.from_user_input(crs)
    east, north = Transformer.from_crs(system, "EPSG:4326", always_xy=True).transform(*origin[:2])
    where = f"at longitude {east:.5f}, latitude {north:.5f}"
    area = system.area_of_use
    inside = bool(np.isfinite([east, north]).all())
    if inside and area is not None:
        inside = area.south - BEYOND <= north <= area.north + BEYOND
        wide = (area.east - area.west) % 360 or 360.0
        inside &= (east - area.west + BEYOND) % 360 <= wide + 2 * BEYOND
    if not inside:
        held = f" ({area.name})" if area is not None else ""
        rule = f"the rock lies where {crs} holds{held[:150]}"
        remedy = "give the system of the scan, and an origin only where the scan has one of its own"
        key = "georeference.origin"
        raise InputError(Problem(site.file_of(key), key, f"a rock {where}", rule, remedy))
    own = Transformer.from_crs(system, system.geodetic_crs, always_xy=True)  # whose meridian is 0
    unit = system.geodetic_crs.axis_info[0].unit_conversion_factor  # not always a degree
    scales = Proj(system).get_factors(*np.degrees(unit * np.array(own.transform(*origin[:2]))))
    metre = max((scales.meridional_scale, scales.parallel_scale), key=lambda one: abs(one - 1.0))
    if not abs(metre - 1.0) <= STRETCH:
        key, given = (
            "georeference.crs",
            f"{crs}, in which a metre on the ground {where} is {metre:.4g}",
        )
        rule = f"it is 1 to {STRETCH:.0%}, or the scan has another size than the rock"
        remedy = "give the system of the scan, e.g. the zone of UTM"
        raise InputError(Problem(site.file_of(key), key, given, rule, remedy))
    return where


def layers(displacement: xr.Dataset, origin: Array, starts: xr.DataArray) -> tuple[Layer, Layer]:
    """Points at which the centre of mass ended, and lines along which it went.

    Parameters
    ----------
    origin : ndarray, shape (3,) [m], of the site's frame in the coordinate reference system
    starts : DataArray, dimensions friction and xyz [m]
        Centre of mass of the rock at rest, in the site's frame.

    Returns
    -------
    tuple of two layers
        A run that never left its start has an end, and no path. Of an unresolved run nobody knows
        where it ends.
    """
    size = displacement["row_size"].values
    runs = displacement.assign(number=("run", np.arange(len(size), dtype=np.int32)))
    place = origin + np.column_stack([displacement[name].values.astype(float) for name in "xyz"])
    known = displacement["stop_reason"].values != StopReason.UNDONE
    ends = origin + starts.sel(friction=displacement["friction"].values).values
    ends[size > 0] = place[np.cumsum(size)[size > 0] - 1]
    long = size > 1
    run = np.repeat(np.cumsum(long) - 1, size)[np.repeat(long, size)]
    lines = shapely.linestrings(place[np.repeat(long, size)], indices=run)
    return (shapely.points(ends[known]), runs.isel(run=known)), (lines, runs.isel(run=long))


def attributes(runs: xr.Dataset) -> dict[str, NDArray[Any]]:
    """What is told of each run, by name and unit, arrays of shape (run,)."""
    found = {
        "run": runs["number"].values,
        "yaw_deg": runs["yaw"].values,
        "pga_g": runs["pga"].values,
        "pgv_pga_s": runs["pgv_pga"].values,
        "friction": runs["friction"].values,
        "trajectory_length_m": runs["trajectory_length"].values,
    }
    words = {
        "outcome": [Outcome(code).name.lower() for code in runs["outcome"].values],
        "movement": [_movement(code) for code in runs["movement"].values],
        "ended": [STOPS[StopReason(code)] for code in runs["stop_reason"].values],
    }
    if "record" in runs:
        words["record"] = runs["record"].values.astype(str).tolist()
    return found | {name: np.array(told, dtype=object) for name, told in words.items()}


def _movement(code: int) -> str:
    """How the rock moved, in words; a run without a verdict has no movement."""
    return Movement(code).words if code >= 0 else STOPS[StopReason.UNDONE]


def _written(driver: str, of: dict[str, Layer], crs: str) -> Writer:
    """Writer of a file of one or more layers."""
    import pyogrio

    def write(path: Path) -> None:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": WHEN})
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / f"file.{'gpkg' if driver == 'GPKG' else 'geojson'}"
            for layer, (shapes, runs) in of.items():
                fields = attributes(runs)
                pyogrio.raw.write(
                    file,
                    geometry=shapely.to_wkb(shapes),
                    geometry_type="Point Z" if layer == "end_positions" else "LineString Z",
                    field_data=list(fields.values()),
                    fields=np.array(list(fields)),
                    crs=crs,
                    layer=layer,
                    append=file.exists(),
                    driver=driver,
                    layer_options={} if driver == "GPKG" else RFC_7946,
                )
            path.write_bytes(file.read_bytes())

    return write
