"""A rock that is not convex as convex parts, by CoACD in a process of its own.

CoACD (Wei et al. 2022) is native code that ends the interpreter when it fails.
"""

from __future__ import annotations

import importlib.util
import io
import subprocess
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vsr_core.errors import Unfit
from vsr_core.scan.weigh import tips_of

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

CONVEX = 0.05
"""A rock whose hull has at most this much more volume is convex: its hull stands for it. Contacts
are then at most as deep off as the rock's hollows, and what it can stand on is the hull anyway."""

CONCAVITY = 0.03
"""Depth of the hollows that parts may keep, of the rock's size (CoACD's threshold)."""

TIME = 300.0
"""Longest that CoACD may take [s]."""


@dataclass(frozen=True)
class Parts:
    """Convex parts that stand for a rock.

    Attributes
    ----------
    hulls : tuple of ndarray, shape (k, 3) [m], vertices of each part
    volume_error : float, volume of all parts over that of the rock, less 1
    tipping_change : float [rad], largest change of a static tipping angle
    reason : str, why the rock is one part or several
    """

    hulls: tuple[Array, ...]
    volume_error: float
    tipping_change: float
    reason: str


def parts(rock: trimesh.Trimesh) -> Parts:
    """Convex parts of a closed rock: its hull, or CoACD's where the rock is far from convex.

    Raises
    ------
    Unfit
        If CoACD is needed and missing, fails or takes too long.
    """
    hull = rock.convex_hull
    excess = float(hull.volume / rock.volume) - 1.0
    reason = f"its hull has {excess:.1%} more volume; up to {CONVEX:.0%} counts as convex"
    if excess <= CONVEX:
        return _weighed(rock, (np.array(hull.vertices),), reason)
    return _weighed(rock, _by_coacd(rock), reason)


def _weighed(rock: trimesh.Trimesh, hulls: tuple[Array, ...], reason: str) -> Parts:
    from scipy.spatial import ConvexHull

    centre = np.array(rock.center_mass)
    volume = sum(float(ConvexHull(points).volume) for points in hulls)
    change = tips_of(np.concatenate(hulls) - centre) - tips_of(np.array(rock.vertices) - centre)
    return Parts(hulls, volume / float(rock.volume) - 1.0, float(np.abs(change).max()), reason)


def _by_coacd(rock: trimesh.Trimesh) -> tuple[Array, ...]:
    if importlib.util.find_spec("coacd") is None:
        raise Unfit(
            "a rock that is far from convex, without CoACD",
            "it is taken apart by the package coacd",
            "install it, or use the rock's hull",
        )
    given = io.BytesIO()
    np.savez(given, vertices=np.array(rock.vertices), faces=np.array(rock.faces))
    code = "from vsr_core.scan.decompose import child; child()"
    try:
        done = subprocess.run(  # noqa: S603 (this interpreter, a fixed line)
            [sys.executable, "-c", code],
            input=given.getvalue(),
            capture_output=True,
            timeout=TIME,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise _failed(f"takes longer than {TIME:.0f} s") from error
    if done.returncode != 0:
        raise _failed(f"ends with code {done.returncode}")
    with np.load(io.BytesIO(done.stdout)) as found:
        return tuple(found[name] for name in found.files)


def _failed(how: str) -> Unfit:
    return Unfit(
        f"a rock on which CoACD {how}",
        "a rock far from convex is taken apart into convex parts",
        "simplify the rock first, or use its hull",
    )


def child() -> None:
    """Take a rock on standard input apart, onto standard output; CoACD's own words go to error."""
    import os

    result = os.dup(1)
    os.dup2(2, 1)
    import coacd

    coacd.set_log_level("error")
    with np.load(io.BytesIO(sys.stdin.buffer.read())) as given:
        mesh = coacd.Mesh(given["vertices"], given["faces"])
    found = io.BytesIO()
    np.savez(found, *[points for points, _ in coacd.run_coacd(mesh, threshold=CONCAVITY)])
    with os.fdopen(result, "wb") as out:
        out.write(found.getvalue())
