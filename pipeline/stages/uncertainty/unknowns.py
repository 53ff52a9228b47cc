"""What was drawn, as numbers: for the dataset, for the indices and for the table of priors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from threadpoolctl import threadpool_limits

from pipeline.config import in_si
from pipeline.config.priors_schema import PriorsConfig, UncertaintyConfig
from pipeline.stages.uncertainty.draws import Draw, base_alone
from vsr_core.arrays import Array
from vsr_core.uncertainty import search
from vsr_core.uncertainty.sensitivity import Unknown
from vsr_core.validation.priors import Priors
from vsr_core.validation.specimen import Form

KINDS = {"rim": "its rim", "points": "3 to 6 points of it", "whole": "all of it"}
"""What of the seam bears the rock, in words, by key."""


def base_effects(draws: Sequence[Draw], shape: Form, density: float, given: Array) -> Array:
    """What the drawn base alone does to the static tipping, shape (draws, 2, yaws) [ln].

    Parameters
    ----------
    density : float [kg m-3]
    given : ndarray, shape (5, yaws), static scales of the site's own rock

    Returns
    -------
    ndarray, for the side that a pulse pushes the rock to first, and for the other
    """
    yaws = np.radians(draws[0].yaw)
    with threadpool_limits(1):  # as in ``draws``
        hulls = [base_alone(draw, shape, density).hull for draw in draws]
    return np.array([search.scales(hull, yaws)[1:3] - given[1:3] for hull in hulls])


def seat_effects(draws: Sequence[Draw], given: Array) -> Array:
    """What the drawn seat alone does to the static tipping, and whether all of the seam bears.

    Parameters
    ----------
    given : ndarray, shape (5, yaws), static scales of the site's own rock on its seat

    Returns
    -------
    ndarray, shape (draws, 3, yaws), of zero mean and about unit variance
    """
    yaws, seats = np.radians(draws[0].yaw), [(draw.seat, draw.member) for draw in draws]
    points = [seat.outline + member.centre for seat, member in seats if seat]
    ways = np.array([search.scales_on(one, yaws)[1:3] - given[1:3] for one in points])
    whole = np.array([float(seat.bearing == "whole") for seat, _ in seats if seat])
    flags = np.broadcast_to(whole[:, None, None], (len(whole), 1, len(yaws)))
    parts = [(part - part.mean(axis=0)) / max(float(part.std()), 1e-12) for part in (ways, flags)]
    return np.concatenate(parts, axis=1)


def unknowns(draws: Sequence[Draw], known: Priors, base: Array | None, yaw: int) -> list[Unknown]:
    """What may decide the boundary in a direction; without what the priors hold fixed.

    Parameters
    ----------
    base : ndarray, as ``base_effects`` or ``seat_effects`` gives it, or None where draws lie
        between two scans
    """
    members = [draw.member for draw in draws]
    found: list[Unknown] = []

    def add(name: str, values: NDArray[np.floating[Any]], prior: Callable[[Array], Array]) -> None:
        if np.ptp(values, axis=0).any():
            found.append(Unknown(name, values.reshape(len(draws), -1).astype(np.float64), prior))

    if known.azimuth[1]:
        azimuth = np.array([member.azimuth for member in members])
        add("direction of the shaking", (azimuth - known.azimuth[0]) / known.azimuth[1], ndtri)
    share, signs = (
        known.polarity_reversal_probability,
        np.array([1.0 if m.reversed else -1.0 for m in members]),
    )
    add("sign of the motion", signs, lambda u: np.where(u < share, 1.0, -1.0))
    for name in ("friction", "restitution"):
        own = np.array([getattr(member, name) for member in members])
        add(name, _scaled(own, getattr(known, name)), _unit)
    mean, gain = known.amplitude
    if gain:
        gains = (np.array([member.amplitude for member in members]) - mean) / gain
        add("gain of the motion", gains, ndtri)
    if base is None:
        mixing, inset = np.array([(member.mixing, member.inset) for member in members]).T
        add("shape between the scans", _scaled(mixing, known.mixing), _unit)
        add("inset of the base", _scaled(inset, known.inset), _unit)
    else:
        effect = base[:, :, yaw] / max(float(base[:, :, yaw].std()), 1e-12)
        name = "seat" if draws[0].seat else "base"
        add(name, effect, lambda u: effect[(u[:, 0] * len(effect)).astype(int)])
    if known.centre:
        turn = math.radians(draws[0].yaw[yaw])
        x, y, z = np.array([member.centre for member in members]).T / known.centre
        along = math.cos(turn) * x - math.sin(turn) * y
        across = math.sin(turn) * x + math.cos(turn) * y
        add("centre of mass", np.column_stack([along, across, z]), ndtri)
    return found


def _unit(uniform: Array) -> Array:
    """From uniform numbers on (0, 1) to uniform numbers of zero mean and unit variance."""
    return np.asarray((2.0 * uniform - 1.0) * math.sqrt(3.0))


def _scaled(values: Array, ends: tuple[float, float]) -> Array:
    """From uniform numbers between two ends to those; zeros where the ends are one."""
    width = ends[1] - ends[0]
    return _unit((values - ends[0]) / width) if width else np.zeros(len(values))


def assumed(config: UncertaintyConfig, *, box: bool, terrain: bool) -> list[tuple[str, str, str]]:
    """The priors in words.

    Parameters
    ----------
    terrain : bool, whether the rock was scanned with its ground

    Returns
    -------
    list of (unknown, prior, key of the configuration)
    """
    error = config.base_error * config.scan.error
    if box:
        base = "exact, as a box has no scan"
    elif config.scan.replica:
        base = f"between two scans, share of the second: {uniform(config.replica_fraction)}"
    else:
        base = (
            f"scan with a normal error of {1e3 * error:g} mm, alike over "
            f"{1e3 * config.scan.correlation_length:g} mm"
        )
    first = [("base", base, "scan")]
    if not box:
        first.append(inset(config))
    if terrain:
        shares = config.seat.shares
        kinds = (f"{name} {100 * shares[key]:.0f} %" for key, name in KINDS.items() if shares[key])
        first = [
            ("what of the seam bears the rock", ", ".join(kinds), "seat"),
            ("outline of the seam", base, "scan"),
        ]
    return [*first, *in_words(config, "from each yaw")]


def inset(config: PriorsConfig) -> tuple[str, str, str]:
    """The prior of how far inside its hull a rock bears."""
    words = f"{uniform(config.inset)}, relative to the height of the centre of mass"
    return "inset of the base from the hull", words, "inset"


def in_words(config: PriorsConfig, azimuth_from: str) -> list[tuple[str, str, str]]:
    """The priors that a site and a series of tests have in common.

    Returns
    -------
    list of (unknown, prior, key of the configuration)
    """
    azimuth, gain = config.azimuth, config.amplitude
    mean = f"{azimuth.mean:g}".replace("-", "\N{MINUS SIGN}")
    return [
        ("friction", uniform(config.friction), "friction"),
        ("restitution", uniform(config.restitution), "restitution"),
        (
            "centre of mass, with uneven density",
            f"normal, {1e3 * config.centre_of_mass:g} mm along each axis",
            "centre_of_mass",
        ),
        (
            "direction of the shaking",
            f"normal, {mean} ± {azimuth.sd:g} deg {azimuth_from}",
            "azimuth",
        ),
        (
            "sign of the motion",
            f"the other way with a probability of {config.polarity_reversal_probability:g}",
            "polarity_reversal_probability",
        ),
        ("gain of the motion", f"normal, {gain.mean:g} ± {gain.sd:g}", "amplitude"),
    ]


def uniform(ends: tuple[float, float]) -> str:
    """A uniform prior in words.

    Parameters
    ----------
    ends : (low, high)

    >>> uniform((0.5, 0.9)), uniform((0.0, 0.0))
    ('uniform from 0.5 to 0.9', '0, taken as known')
    """
    low, high = ends
    return f"{low:g}, taken as known" if low == high else f"uniform from {low:g} to {high:g}"


def drawn_values(draws: Sequence[Draw]) -> dict[str, tuple[tuple[str, ...], NDArray[Any]]]:
    """What was drawn, as variables of a dataset on (member).

    Returns
    -------
    dict of (dimensions, values) by name
    """
    members = [draw.member for draw in draws]
    values: dict[str, tuple[tuple[str, ...], NDArray[Any]]] = {
        f"drawn_{name}": (("member",), np.array([getattr(member, name) for member in members]))
        for name in ("friction", "restitution", "amplitude", "mixing", "inset", "seed")
    }
    azimuth = np.array([in_si.in_degrees(member.azimuth) for member in members])
    values["drawn_azimuth"] = (("member",), azimuth)
    back = np.array([member.reversed for member in members], np.int8)
    values["drawn_reversed"] = (("member",), back)
    centre = np.array([member.centre for member in members])
    values["drawn_centre"] = (("member", "xyz"), centre)
    if draws[0].seat:
        seats = np.array([str(draw.seat.bearing) for draw in draws if draw.seat])
        values["drawn_seat"] = (("member",), seats)
    return values
