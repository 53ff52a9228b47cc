"""Warnings of values that look like an error of unit or typing, or that have no part in a scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from pipeline.config.hazard_schema import LONGEST, YOUNGEST
from pipeline.config.layers import Site
from pipeline.config.problems import Problem
from pipeline.config.schema import TableConfig
from pipeline.config.sections import STRONG_PGA

Values = tuple[float, ...]


@dataclass(frozen=True)
class Slip:
    """A common error of unit or typing.

    Attributes
    ----------
    keys : dotted keys, separated by blanks
    suspect : callable, whether the values of a key look like this error
    """

    keys: str
    suspect: Callable[[Values], bool]
    rule: str
    remedy: str


def _above(limit: float) -> Callable[[Values], bool]:
    return lambda values: max(values) > limit


def _below(limit: float) -> Callable[[Values], bool]:
    return lambda values: min(values) < limit


def _between(low: float, high: float) -> Callable[[Values], bool]:
    return lambda values: any(low < value < high for value in values)


def radians_of(name: str, degrees: Iterable[float | None]) -> Iterator[str]:
    """A column of degrees that are radians, probably, in words."""
    found = tuple(one for one in degrees if one is not None)
    if found and _in_a_turn(found):
        yield f"{name} from {min(found):g} to {max(found):g}: radians?"


def _in_a_turn(values: Values) -> bool:
    whole = all(value == round(value) for value in values)
    return not whole and max(map(abs, values)) <= round(2.0 * math.pi, 1)


def _beside_zero(values: Values) -> bool:
    whole = [value for value in values if value >= 1.0 and value == round(value)]
    return len(values) == 2 and 0.0 in values and len(whole) == 1


NO_SLIDING = 10.0
"""The friction that stands for no sliding."""

_AGES = " ".join(
    f"{age}.{name}"
    for age in ("hazard.age", "hazard.history.until", "hazard.rocks.age")
    for name in ("mean", "median", "low", "values")
)
_LATEST = _AGES.replace("low", "high")

SLIPS = (
    Slip(
        "yaw motion.records.azimuth observations.direction",
        _in_a_turn,
        "directions are in degrees",
        "radians? write 45 for 0.785",
    ),
    Slip(
        "uncertainty.azimuth.sd azimuth.sd",
        _between(0.0, 0.5),
        "directions are in degrees",
        "radians? write 5 for 0.087",
    ),
    Slip(
        "motion.pga hazard.pgv_pga.pga",
        _above(STRONG_PGA),
        "PGA is in g, and records rarely exceed 4 g",
        "m/s2? write 1 for 9.81 m/s2",
    ),
    Slip(
        "motion.pgv_pga",
        _above(2.0),
        "PGV/PGA is in seconds, and that of records is 0.02 to 0.5 s",
        "cm/s per g? write 0.1 for 98 cm/s per g; Hz? a pulse of f Hz has 1/(2 pi f) s",
    ),
    Slip(
        "hazard.pgv_pga.median",
        _above(0.6),
        "PGV/PGA is in seconds, and the median of earthquakes is 0.02 to 0.5 s",
        "m/s per g? write 0.08 for 0.785 m/s per g",
    ),
    Slip(
        "contact.friction uncertainty.friction friction",
        _beside_zero,
        "this list has two coefficients, one of them zero",
        "decimal comma? write 0.6",
    ),
    Slip(
        "contact.friction uncertainty.friction friction",
        lambda values: any(value > 2.0 and value != NO_SLIDING for value in values),
        f"friction is a coefficient, about 0.6 for rock on rock; {NO_SLIDING:g} is no sliding",
        "degrees? write 0.70 for 35 degrees",
    ),
    Slip(
        "rock.density",
        _between(15.0, 35.0),
        "density is in kg m-3, 1500 to 3500 for rock",
        "kN/m3? write 2650 for 26 kN/m3",
    ),
    Slip(
        "rock.density",
        _between(100.0, 220.0),
        "density is in kg m-3, 1500 to 3500 for rock",
        "lb/ft3? write 2640 for 165 lb/ft3",
    ),
    Slip("rock.size", _above(15.0), "lengths are in metres", "cm? write 0.12 for 12 cm"),
    Slip(
        "uncertainty.centre_of_mass uncertainty.scan.error",
        _above(0.2),
        "lengths are in metres",
        "cm? write 0.01 for 1 cm",
    ),
    Slip(
        "motion.processing.highpass",
        _above(2.0),
        "the corner is a frequency in Hz, usually below 0.5",
        "a period in seconds? write 0.1 for 10 s",
    ),
    Slip(
        "motion.processing.lowpass",
        _below(5.0),
        "the corner is a frequency in Hz, usually above 10",
        "a period in seconds? write 25 for 0.04 s",
    ),
    Slip(_AGES, _below(YOUNGEST), "ages are in years", "thousands of years? write 20000 for 20 ka"),
    Slip(
        _LATEST,
        _above(LONGEST),
        "rocks that may topple stand for less than a million years",
        "two ages in one line? correct it",
    ),
)


IDLE = (
    (
        "pedestal.mesh pedestal.cut pedestal.point_on_rock rock.pose",
        ("pedestal.shape", "flat"),
        "level ground has no part for it",
        "leave it out, or set pedestal.shape: mesh",
    ),
    (
        "rock.mesh rock.scale",
        ("rock.shape", "box"),
        "a box is as large as rock.size says",
        "leave it out, or set rock.shape: mesh",
    ),
)
"""Settings that have no part beside another: that one, its value, and what to tell."""

UNUSED = (
    *IDLE,
    (
        "pedestal.seat pedestal.fallback rock.contact_shape rock.contact_error",
        ("pedestal.shape", "flat"),
        "level ground has no part for it",
        "sweep it where pedestal.shape is mesh",
    ),
    (
        "rock.fallback rock.closing",
        ("rock.shape", "box"),
        "a box is not scanned",
        "sweep it where rock.shape is mesh",
    ),
    (
        "contact.restitution_law",
        ("contact.restitution", 0.0),
        "without restitution no law of it has a part",
        "sweep it where contact.restitution is above 0",
    ),
)
"""The same for who sweeps them; as they have values where nobody gives any, no site is warned."""


OF_TABLES = (
    Slip("velocity", _above(20.0), "velocities are in m/s", "mm/s? write 0.5 for 500 mm/s"),
    Slip("stroke", _above(20.0), "strokes are in metres", "mm? write 0.3 for 300 mm"),
    Slip("pulley_diameter", _above(1.0), "diameters are in metres", "mm? write 0.054 for 54 mm"),
)
"""Those of the limits of a shake table."""


def warnings(site: Site) -> Iterator[Problem]:
    """Values of a site that look like a common error, or that it has no part for."""
    settings = site.settings.model_dump()
    yield from _idle(site, settings)
    yield from _suspected(settings, site.file_of, SLIPS)


def warnings_of_table(table: TableConfig, file: str) -> Iterator[Problem]:
    """Limits of a shake table that look like a common error."""
    return _suspected(table.model_dump(), lambda _: file, OF_TABLES)


def _suspected(
    settings: dict[str, Any], file_of: Callable[[str], str], slips: tuple[Slip, ...]
) -> Iterator[Problem]:
    warned = set()
    for slip in slips:
        for key in slip.keys.split():
            values = _values(settings, key)
            if values and key not in warned and slip.suspect(values):
                warned.add(key)
                given = ", ".join(f"{value:g}" for value in values[:3])
                given += f" to {values[-1]:g}" if len(values) > 3 else ""
                yield Problem(file_of(key), key, given, slip.rule, slip.remedy)


def _idle(site: Site, settings: dict[str, Any]) -> Iterator[Problem]:
    for keys, (one, value), rule, remedy in IDLE:
        section, _, own = one.partition(".")
        if settings.get(section, {}).get(own) == value:
            for key in keys.split():
                above, _, name = key.partition(".")
                given = settings[above].get(name) if above in settings else None
                over = _is_over(site, one, key)
                if given not in (None, 1.0) and not over:  # the scale of a file in metres
                    yield Problem(site.file_of(key), key, str(given), rule, remedy)


def _is_over(site: Site, one: str, other: str) -> bool:
    """Whether a key is set in a layer over that of another, which then may be idle."""
    place, below = site.places.get(tuple(one.split("."))), site.file_of(other)
    return place is not None and below != "--set" and place[0] not in (site.file, below)


def _values(settings: Any, key: str) -> Values:
    """Numbers at a key, of each of several entries."""
    found = [settings]
    for part in key.split("."):
        each = (one for one in _spread(found) if isinstance(one, dict))
        found = [one.get(part) for one in each]
    return tuple(value for value in _spread(found) if isinstance(value, float | int))


def _spread(found: list[Any]) -> Iterator[Any]:
    for one in found:
        yield from one if isinstance(one, tuple) else (one,)
