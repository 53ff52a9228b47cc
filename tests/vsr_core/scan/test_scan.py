"""From surrogate scans, whose true solids are known, to rock and ground."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import trimesh

from vsr_core.scan.preparation import Prepared, prepare_scan
from vsr_core.scan.weighing import measured
from vsr_core.surrogates import SITES
from vsr_core.surrogates.raw_scan import RawScan, scan

BOTH = pytest.mark.parametrize("name", ["double_rock_terrain", "granite_dells"])

pytestmark = pytest.mark.slow
"""Of large scans; ``tests/pipeline/stages/mesh/test_prep.py`` asks the same of a small one."""


@cache
def prepared(name: str) -> tuple[Prepared, RawScan, trimesh.Trimesh]:
    """What the workflow makes of a site's scan, the scan, and the true rock."""
    site = SITES[name]()
    raw = scan(site)
    top = raw.offset + np.array([0.0, 0.0, 1.0])
    mesh = trimesh.Trimesh(raw.vertices, raw.faces, process=False)
    near = tuple(top) if name == "granite_dells" else None
    made = prepare_scan(lambda: mesh, None, near=near, closing="caps", density=2110.0, tell=str)
    return made, raw, trimesh.Trimesh(site.rock_vertices, site.rock_faces, process=False)


@BOTH
def test_centre_of_mass_and_inertia_are_those_of_the_true_rock(name: str) -> None:
    made, raw, truth = prepared(name)
    size = np.ptp(truth.vertices, axis=0).max()
    off = made.rock.center_mass + made.origin - raw.offset - truth.center_mass
    assert np.linalg.norm(off) < 0.005 * size
    change = np.abs(np.array(made.rock.moment_inertia) - truth.moment_inertia).max()
    assert change < 0.02 * np.abs(truth.moment_inertia).max()


@BOTH
@pytest.mark.xfail(strict=True, reason="the unseen base decides; an edge is right to a centimetre")
def test_tipping_angles_are_right_to_half_a_degree(name: str) -> None:
    made, _, truth = prepared(name)
    found, true = (measured(solid, 1.0).tipping for solid in (made.rock, truth))
    assert np.degrees(np.abs(found - true).max()) < 0.5


@BOTH
def test_site_frame_stands_on_the_rock(name: str) -> None:
    made, _, _ = prepared(name)
    assert made.rock.center_mass[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert made.rock.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    assert made.rock.is_watertight
    assert made.rock.volume > 0.0


@BOTH
def test_ground_is_one_sheet_that_leaves_the_rock_alone(name: str) -> None:
    made, _, _ = prepared(name)
    ground = trimesh.Trimesh(made.terrain.vertices, made.terrain.faces, process=False)
    edges, count = np.unique(ground.edges_sorted, axis=0, return_counts=True)
    assert count.max() == 2
    border = np.unique(edges[count == 1])
    assert np.hypot(*made.terrain.vertices[border, :2].T).min() > 3.0  # no hole under the rock
    below = np.array([made.terrain.depth(p) for p in made.rock.triangles_center[::7]])
    assert below.max() < 0.01


def test_the_seam_is_where_the_scan_says() -> None:
    """Faces called rock are the rock's, to within a row of faces along the seam."""
    made, raw, _ = prepared("double_rock_terrain")
    middles = made.separation.vertices[made.separation.faces[made.separation.rock]].mean(axis=1)
    true = (raw.vertices[raw.faces[raw.rock]].mean(axis=1)) - (made.origin + made.shift)
    assert len(middles) == pytest.approx(len(true), rel=0.03)
