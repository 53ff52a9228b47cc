"""`vsr compare`: what differs between two results is told, and nothing else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import Ran

from pipeline import cli
from pipeline.bundles.comparison import _matched
from pipeline.workflow.keys import digest_file
from pipeline.workflow.store import manifest_text, read_manifest

GRID = "motion: {pga: [0.2, 0.4, 0.8], pgv_pga: [0.2, 0.5]}\nyaw: [0]\n"


@pytest.mark.slow
def test_settings_cells_and_boundaries_that_differ_are_told(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, tmp_path: Path
) -> None:
    for name, more in (("one", ""), ("other", "contact: {friction: 0.3}\n")):
        site = write_site(GRID.replace("yaw", f"{more}yaw"), name)
        assert vsr("run", "fragility", "--site", site, "--workers", "0").code == cli.DONE
    page, bundle = tmp_path / "comparison.html", tmp_path / "one.zip"
    assert vsr("export", derived / "one", "--to", bundle).code == cli.DONE
    same = vsr("compare", derived / "one", bundle, "--to", page)
    assert (same.code, same.out) == (cli.DONE, "no difference\n")
    told = vsr("compare", bundle, derived / "other", "--to", page).out
    assert "settings: contact.friction changed: [0.6] is now [0.3]" in told
    assert "cells: friction 0.6 beside 0.3" in told
    assert "boundary: friction 0.6 beside 0.3" in told
    assert page.read_text().count("<li>") == len(told.splitlines())

    path = derived / "one" / "responses.nc"
    with xr.load_dataset(path) as data:
        changed = data.copy(deep=True)
    before = int(changed.outcome[0, 0, 0, 0])
    changed.outcome[0, 0, 0, 0] = 5
    written(changed, derived / "one", "responses")
    with xr.load_dataset(derived / "one" / "fragility.nc") as data:
        moved = data.copy(deep=True)
    finite = int(np.isfinite(moved.first_overturning_pga).sum())
    moved["first_overturning_pga"] = 1.1 * moved.first_overturning_pga
    written(moved, derived / "one", "fragility")
    lines = vsr("compare", bundle, derived / "one", "--to", page).out.splitlines()
    assert before == 0
    same = "holds other values, though it is made of the same"
    assert lines[:2] == [f"made of: {one}: {one}.nc {same}" for one in ("fragility", "responses")]
    assert lines[2] == "cells: 1 of 6 cells: balanced and crashed"
    assert lines[3].startswith(f"boundary: {finite} of 2 first-overturning PGAs differ")
    assert "10 % at most" in lines[3]
    (derived / "one" / "responses.nc").write_bytes(path.read_bytes() + b"?")
    damaged = vsr("compare", bundle, derived / "one", "--to", page)
    assert (damaged.code, "not what was written" in damaged.err) == (cli.REFUSED, True)


@pytest.mark.slow
def test_products_of_other_settings_than_beside_them_are_told_and_not_exported(
    vsr: Callable[..., Ran], write_site: Callable[..., str], tmp_path: Path
) -> None:
    site, bundle = write_site(GRID), tmp_path / "study.zip"
    for name, more in (("one", ()), ("other", ("--set", "contact.friction=0.3"))):
        make = ("run", "responses", "--site", site, "--workers", "0", *more)
        assert vsr(*make, into=tmp_path / name).code == cli.DONE
    make = ("run", "rock", "--site", site, "--workers", "0")
    assert vsr(*make, into=tmp_path / "other").code == cli.DONE
    one, other = (tmp_path / name / "rock" for name in ("one", "other"))
    told = vsr("compare", one, other, "--to", tmp_path / "page.html").out
    reason = "contact.friction changed: [0.3] is now [0.6]"
    stale = f"responses is of other settings than config.yaml: {reason}"
    assert f"settings: in the second, {stale}" in told.splitlines()
    assert "settings: contact.friction changed: [0.6] is now [0.3] (" in told
    assert "rock is of other" not in told
    ran = vsr("export", other, "--to", bundle)
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran
    assert "responses: got " in ran.err
    assert reason in ran.err
    assert f"vsr run responses --site {site}" in ran.err
    assert not bundle.exists()


@pytest.mark.slow
def test_what_has_no_place_in_common_is_not_said_to_be_alike(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, tmp_path: Path
) -> None:
    for name, yaw, pga in (("one", "[0, 30]", "[0.2, 0.4]"), ("other", "[60, 90]", "[0.2, 0.6]")):
        grid = f"motion: {{pga: {pga}, pgv_pga: [0.2, 0.5]}}\nyaw: {yaw}\n"
        assert vsr("run", "fragility", "--site", write_site(grid, name), "--workers", "0").code == 0
    told = vsr("compare", derived / "one", derived / "other", "--to", tmp_path / "page.html").out
    none = "not comparable: no yaw in both: 0.0, 30.0 and 60.0, 90.0"
    assert [line for line in told.splitlines() if line.startswith(("cells", "boundary"))] == [
        f"cells: {none}",
        "cells: compared at the 1 of 2 and 2 pga in both",
        f"boundary: {none}",
    ]


@pytest.mark.slow
def test_pulses_and_records_are_said_to_be_not_comparable(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, tmp_path: Path
) -> None:
    times = 0.01 * np.arange(201)
    sine, cosine = np.sin(0.5 * np.pi * times), np.cos(0.5 * np.pi * times)
    shaking = 12.0 * (3.0 * sine**2 * cosine**2 - sine**4)  # of a table that goes as sin^4
    rows = "".join(f"{t:.2f},{a:.6f}\n" for t, a in zip(times, shaking, strict=True))
    (tmp_path / "shake.csv").write_text(f"time,acceleration\n{rows}")
    processing = "{order: none, highpass: null, lowpass: null}"
    record = (
        "motion: {kind: record, files: shake.csv, pga: [0.2, 0.4], unit: m/s2,"
        f" processing: {processing}}}\nyaw: [0]\n"
    )
    for name, motion in (("pulse", GRID), ("record", record)):
        run = vsr("run", "fragility", "--site", write_site(motion, name), "--workers", "0")
        assert run.code == cli.DONE, run.err
    ran = vsr("compare", derived / "pulse", derived / "record", "--to", tmp_path / "page.html")
    start = "not comparable: along yaw, friction"
    assert [line for line in ran.out.splitlines() if line.startswith(("cells", "boundary"))] == [
        f"cells: {start}, pgv_pga and pga in the first, along yaw, friction, record and pga"
        " in the second",
        f"boundary: {start} and pgv_pga in the first, along yaw, friction and record in the second",
    ]


def test_what_neither_has_made_is_not_said_to_be_alike(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, tmp_path: Path
) -> None:
    for name in ("one", "other"):
        assert vsr("run", "rock", "--site", write_site(GRID, name), "--workers", "0").code == 0
    told = vsr("compare", derived / "one", derived / "other", "--to", tmp_path / "page.html").out
    assert "cells: not compared: responses.nc is not in both" in told
    assert "boundary: not compared: fragility.nc is not in both" in told


def written(data: xr.Dataset, folder: Path, stage: str) -> None:
    """Put a dataset in place of a stage's, as if the stage had written it."""
    data.to_netcdf(folder / f"{stage}.nc")
    manifest = folder / ".stages" / f"{stage}.json"
    told = read_manifest(manifest)
    assert told is not None
    told["files"][f"{stage}.nc"] = digest_file(folder / f"{stage}.nc")
    manifest.write_text(manifest_text(told))


def test_what_is_no_result_is_refused(vsr: Callable[..., Ran], tmp_path: Path) -> None:
    ran = vsr("compare", tmp_path, tmp_path / "nothing", "--to", tmp_path / "page.html")
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1)
    assert not list(tmp_path.glob("*.html"))


def test_places_that_differ_in_a_last_digit_are_the_same_unless_that_makes_two_of_one() -> None:
    one = xr.DataArray([1.0, 2.0], {"friction": [0.6, 0.8]}, "friction")
    other = one.assign_coords(friction=[0.6 + 1e-12, 0.8])
    a, b, note = _matched(one, other, "friction")
    assert (a.values.tolist(), b.values.tolist(), note) == ([1.0, 2.0], [1.0, 2.0], "")
    close = xr.DataArray([1.0, 2.0, 3.0], {"friction": [0.6, 0.6 + 1e-12, 0.9]}, "friction")
    a, b, note = _matched(close, one, "friction")
    assert (a.values.tolist(), b.values.tolist()) == ([1.0], [1.0])
    assert "1 of 3 and 2 friction in both" in note


def test_directions_a_turn_apart_are_the_same() -> None:
    one = xr.DataArray([1.0, 2.0, 3.0], {"yaw": [-232.2, -1e-12, 45.0]}, "yaw")
    other = xr.DataArray([4.0, 5.0, 6.0], {"yaw": [0.0, 127.8, 315.0]}, "yaw")
    a, b, note = _matched(one, other, "yaw")
    assert (a.yaw.values.tolist(), "2 of 3 and 3 yaw in both" in note) == ([127.8, 0.0], True)
    assert (a.values.tolist(), b.values.tolist()) == ([1.0, 2.0], [5.0, 4.0])
