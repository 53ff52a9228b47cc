"""`vsr run observations` of a block whose answers are exact, and what is refused."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support import record_files

from pipeline.stages.observations import observations, shaking
from vsr_core import GRAVITY

SITE = """
rock: {shape: box, size: [0.25, 0.8, 1.0], density: 2000}
contact: {friction: 0.7}
motion: {pga: {start: 0.1, stop: 0.5, num: 5}, pgv_pga: {start: 0.2, stop: 0.4, num: 2}}
yaw: 0
simulation: {engine: nonsmooth, time_step: 0.002}
uncertainty: {members: 8, centre_of_mass: 0.02, friction: [0.6, 0.9]}
"""

TILT = "{kind: tilt, direction: 0, angle: 13.5, outcome: tipped, sd: 0.2}"
STOOD = "{kind: tilt, direction: 180, angle: 14, outcome: stood, sd: 0.2}"
PUSH = "{kind: push, direction: 90, force: 1200, height: 1.0, outcome: stood, sd: 50}"
SHAKEN = "{kind: earthquake, year: 1906, pga: 0.2, pga_log_sd: 0.3, pgv: 40, pgv_log_sd: 0.3}"


@pytest.fixture(autouse=True)
def few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(observations, "FIRST", 32)
    monkeypatch.setattr(observations, "MOST", 256)
    monkeypatch.setattr(shaking, "SAMPLES", 2)


def observed(*given: str) -> list[str]:
    """The option that gives observations."""
    return ["--set", f"observations=[{', '.join(given)}]"]


@pytest.fixture
def products(
    vsr: Callable[..., Any], write_site: Callable[..., str], derived: Path
) -> Callable[..., xr.Dataset]:
    """What a command makes of some observations."""

    def make(product: str, *given: str) -> xr.Dataset:
        ran = vsr("run", product, "--site", write_site(SITE), *observed(*given))
        assert ran.code == 0, ran.err
        return xr.load_dataset(derived / "rock" / f"{product}.nc")

    return make


def test_a_tilt_test_tells_where_the_centre_of_mass_is(products: Callable[..., xr.Dataset]) -> None:
    """A block tips at atan((b - x) / (h + z)): 13.5 deg in place of 14.04 puts x 5 mm ahead."""
    found = products("observations", TILT, STOOD)
    weight, centre = found["draw_weight"].values, found["drawn_centre"].values
    angle = np.degrees(np.arctan2(0.125 - centre[:, 0], 0.5 + centre[:, 2]))
    own = found["draw_tipping_pga"].sel(direction=0.0).values
    np.testing.assert_allclose(np.degrees(np.arctan(own)), angle, atol=1e-6)
    assert weight @ angle == pytest.approx(13.5, abs=0.2)
    low, _, high = found["tipping_band"].sel(knowledge="posterior", direction=0.0).values
    assert low < np.tan(np.radians(13.5)) < high
    prior = found["width"].sel(knowledge="prior", direction=0.0)
    assert found["width"].sel(knowledge="posterior", direction=0.0) < 0.5 * prior
    assert found.sizes["draw"] > 32  # few were left, so more were drawn


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_where_friction_alone_is_unknown_no_band_gets_narrower(
    vsr: Callable[..., Any], write_site: Callable[..., str], derived: Path
) -> None:
    """A block that slides from atan 0.1 to 0.2 on, and tips at atan 1/4, stood up to 6 deg."""
    priors = "centre_of_mass: 0, restitution: [0, 0], friction: [0.1, 0.2]"
    site = write_site(SITE.replace("centre_of_mass: 0.02, friction: [0.6, 0.9]", priors))
    test = "{kind: tilt, direction: 0, angle: 6, outcome: stood, sd: 1}"
    ran = vsr("run", "observations", "--site", site, *observed(test))
    assert ran.code == 0, ran.err
    page = (derived / "rock" / "observations.html").read_text()
    assert "nan" not in re.sub("<[^>]*>", " ", page)
    row = re.search(r"<td>([\d.]+) to ([\d.]+)°</td><td[^>]*>\d+</td><td[^>]*>0</td>", page)
    assert row
    low, high = (np.tan(np.radians(float(one))) for one in row.groups())
    assert 0.1 < low < high < 0.2


@pytest.mark.slow
def test_the_ensemble_has_the_rocks_that_are_left(
    products: Callable[..., xr.Dataset], derived: Path
) -> None:
    """And all their shaking; nothing else of it changes but its rocks."""
    ensemble = products("uncertainty", TILT, SHAKEN)
    left = xr.load_dataset(derived / "rock" / "observations.nc")
    taken = left["taken"].values
    assert len(set(taken.tolist())) > 3
    rocks = left["drawn_centre"].values[taken]
    np.testing.assert_array_equal(ensemble["drawn_centre"].values, rocks)
    alone = products("uncertainty")
    for name in ("drawn_azimuth", "drawn_amplitude", "drawn_reversed"):
        np.testing.assert_array_equal(ensemble[name].values, alone[name].values)
    assert not np.array_equal(alone["drawn_centre"].values, rocks)
    page = (derived / "rock" / "observations.html").read_text()
    assert "stood in the earthquake of 1906" in page


def test_an_earthquake_that_none_feels_teaches_nothing(products: Callable[..., xr.Dataset]) -> None:
    weak = SHAKEN.replace("pga: 0.2", "pga: 0.001").replace("pgv: 40", "pgv: 0.1")
    weight = products("observations", weak)["draw_weight"].values
    np.testing.assert_allclose(weight, 1.0 / len(weight))


def test_a_strong_earthquake_leaves_the_strong_rocks(products: Callable[..., xr.Dataset]) -> None:
    """Its samples topple more of the draws whose weaker side tips at less."""
    strong = SHAKEN.replace("pga: 0.2", "pga: 0.24").replace("pgv: 40", "pgv: 60")
    found = products("observations", strong)
    weaker = found["draw_tipping_pga"].values[:, [0, 6]].min(axis=1)
    weight = found["draw_weight"].values
    assert weight @ weaker > weaker.mean()


@pytest.mark.slow
def test_a_shaken_rock_is_run_along_its_direction(
    products: Callable[..., xr.Dataset],
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    tmp_path: Path,
) -> None:
    """0.235 g for 3 s topple what tips at less against their direction, and nothing along y."""
    time = np.arange(0.0, 6.0, 0.01)
    acceleration = 2.3 * (time > 0.0) * (time < 3.0)
    acceleration[400] = np.nan  # at rest before and after
    rows = "\n".join(f"{t:.2f},{a:.3f}" for t, a in zip(time, acceleration, strict=True))
    (tmp_path / "push.csv").write_text(f"time [s],up 000 [m/s2]\n{rows}\n")
    test = "{{kind: shake, motion: push.csv, direction: {}, outcome: stood}}"
    ran = vsr("run", "observations", "--site", write_site(SITE), *observed(test.format(90)))
    assert "push.csv: up 000 as x is taken as horizontal" in ran.err
    assert "push.csv: 1 missing samples at 4 s were bridged by a straight line" in ran.err
    across = products("observations", test.format(90))
    np.testing.assert_allclose(across["draw_weight"], 1.0 / across.sizes["draw"])
    along = products("observations", test.format(0))
    against = along["draw_tipping_pga"].sel(direction=180.0).values
    stands = along["draw_weight"].values > 1.0 / along.sizes["draw"]
    limit = 2.3 / GRAVITY
    assert not stands[against < limit].any()
    assert stands[against > 1.3 * limit].all()


def test_what_is_told_of_a_motion_stands_on_the_page(
    products: Callable[..., xr.Dataset], derived: Path, tmp_path: Path
) -> None:
    """A test that ends with 5 % of its PGA is taken as one with a lasting tilt."""
    time = np.arange(0.0, 6.0, 0.01)
    acceleration = np.where(time < 3.0, 1.0, 0.05)
    rows = "\n".join(f"{t:.2f},{a:.3f}" for t, a in zip(time, acceleration, strict=True))
    (tmp_path / "push.csv").write_text(f"time [s],x [m/s2]\n{rows}\n")
    found = products(
        "observations", TILT, "{kind: shake, motion: push.csv, direction: 90, outcome: stood}"
    )
    words = "a motion that ends with 0.0051 g, 5% of its PGA: as a lasting tilt"
    assert found["repairs"].values[0] == ""
    assert found["repairs"].values[1].startswith(words)
    assert (derived / "rock" / "observations.html").read_text().count(words) == 1


WRONG = {
    "no kind": ("{kind: kick, direction: 0}", "observations.kind", "tilt"),
    "no direction": ("{kind: tilt, angle: 3, outcome: tipped, sd: 1}", "direction", "required"),
    "a direction in words": (TILT.replace("direction: 0", "direction: north"), "direction"),
    "an angle beyond": (TILT.replace("angle: 13.5", "angle: 95"), "angle", "less than 90"),
    "a force in kN": (PUSH.replace("force: 1200", "force: 1.2 kN"), "force", "1.2 kN"),
    "no error": (TILT.replace("sd: 0.2", "sd: 0"), "sd", "greater than or equal to 0.01"),
    "an outcome of another": (TILT.replace("tipped", "lifted"), "outcome", "tipped"),
    "twice": (f"{TILT}, {PUSH}, {TILT}", "observation 3 is observation 1 word for word", "label"),
    "a PGV in m/s": (SHAKEN.replace("pgv: 40", "pgv: 0.4"), "pgv: got 0.4", "0.002 s", "cm/s"),
    "a PGV in mm/s": (SHAKEN.replace("pgv: 40", "pgv: 400"), "pgv: got 400", "2 s", "cm/s"),
    "a toppled one": (SHAKEN.replace("}", ", outcome: toppled}"), "outcome"),
}


@pytest.mark.parametrize("case", WRONG)
def test_an_observation_that_is_none_is_refused(
    refused: Callable[..., str], write_site: Callable[..., str], case: str
) -> None:
    given, *words = WRONG[case]
    refused("run", "observations", "--site", write_site(SITE), *observed(given), words=tuple(words))


@pytest.mark.slow
def test_a_label_tells_two_tests_of_one_kind_apart(products: Callable[..., xr.Dataset]) -> None:
    again = TILT.replace("sd: 0.2", "sd: 0.2, label: second")
    one, two = products("observations", TILT), products("observations", TILT, again)
    share = one["log_likelihood"].values[0]
    np.testing.assert_allclose(two["log_likelihood"].values.sum(axis=0)[:32], 2.0 * share[:32])


IMPOSSIBLE = {
    "beyond geometry": (
        (TILT.replace("13.5", "35"),), "observations.0", "tilted to 35°", "° in the 32 draws"
    ),
    "toppled all": (
        (SHAKEN.replace("pga: 0.2", "pga: 2").replace("pgv: 40", "pgv: 900"),),
        "observations.0", "0 % stand",
    ),
    "twins that contradict": (
        (TILT, TILT.replace("13.5", "16")), "observations.1", "contradicts observations.0"
    ),
    "no file": (("{kind: shake, motion: a.csv, direction: 0, outcome: stood}",),
                "observations.0.motion", "a.csv"),
}  # fmt: skip


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_what_no_draw_explains_is_refused_by_name(
    vsr: Callable[..., Any], write_site: Callable[..., str], derived: Path, case: str
) -> None:
    given, *words = IMPOSSIBLE[case]
    ran = vsr("run", "uncertainty", "--site", write_site(SITE), *observed(*given))
    assert ran.code == 2, ran.err
    lines = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert len(lines) == 1, ran.err
    assert [word for word in words if word not in lines[0]] == [], lines[0]
    assert not list(derived.rglob("observations.*")) + list(derived.rglob("uncertainty.*"))


def test_without_observations_there_is_no_page(
    refused: Callable[..., str], write_site: Callable[..., str]
) -> None:
    words = ("observations: got none", "give one")
    refused("run", "observations", "--site", write_site(SITE), words=words)


def test_what_shaking_taught_is_told_of_the_draws_that_were_shaken(
    products: Callable[..., xr.Dataset], derived: Path
) -> None:
    """A weak earthquake teaches nothing beside a sharp tilt test, which leaves few draws."""
    weak = SHAKEN.replace("pga: 0.2", "pga: 0.001").replace("pgv: 40", "pgv: 0.1")
    found = products("observations", TILT, weak)
    shaken = np.isfinite(found["log_likelihood"].values[1])
    assert 0 < shaken.sum() < found.sizes["draw"]
    assert float(found["alone_effective"][1]) == pytest.approx(shaken.sum())
    page = (derived / "rock" / "observations.html").read_text()
    row = page[page.index("1906") :]
    assert row[row.index("100 % stand") :].startswith(
        '100 % stand</td><td class="n">100</td><td class="n">0</td>'
    )


@pytest.mark.parametrize(
    "kind", ["a pipe", "a device", "too large", "no numbers", "an offset", "up"]
)
def test_a_motion_that_is_no_file_of_numbers_is_refused_at_once(
    vsr: Callable[..., Any], write_site: Callable[..., str], tmp_path: Path, kind: str
) -> None:
    path = tmp_path / "motion.csv"
    if kind == "a pipe":
        os.mkfifo(path)
    elif kind == "a device":
        path = Path("/dev/zero")
    elif kind == "too large":
        with path.open("wb") as file:
            file.truncate(2**30)
    elif kind == "up":
        path = tmp_path / "motion.at2"
        path.write_text(
            record_files.at2(np.sin(np.arange(600) / 20.0), 0.01).replace(" 090\n", " UP\n")
        )
    elif kind == "an offset":
        rows = [f"{0.01 * i:.2f},{3.0 + np.sin(i)}" for i in range(400)]
        path.write_text("\n".join(["time,acceleration [m/s2]", *rows]) + "\n")
    else:
        path.write_bytes(b"\0\xff motion")
    test = f"{{kind: shake, motion: {path}, direction: 0, outcome: stood}}"
    ran = vsr("run", "observations", "--site", write_site(SITE), *observed(test))
    assert ran.code == 2, ran.err
    (line,) = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert "observations.0.motion" in line
    assert path.name in line


def test_what_is_far_from_every_draw_is_refused_after_the_first_of_them(
    vsr: Callable[..., Any], write_site: Callable[..., str]
) -> None:
    ran = vsr(
        "run", "observations", "--site", write_site(SITE), *observed(TILT.replace("13.5", "60"))
    )
    assert ran.code == 2, ran.err
    assert "in the 32 draws of the rock" in ran.err


@pytest.mark.slow
def test_an_ensemble_of_few_rocks_says_that_its_intervals_are_too_narrow(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(observations, "MOST", 32)
    close = TILT.replace("sd: 0.2", "sd: 0.02")
    for given, told in (((close,), True), ((), False)):
        ran = vsr("run", "uncertainty", "--site", write_site(SITE), *observed(*given))
        assert ran.code == 0, ran.err
        page = (derived / "rock" / "uncertainty.html").read_text()
        assert ("intervals that count these are too narrow" in ran.err) == told
        assert ("several draws are of one rock" in page) == told
        if told:
            taken = xr.load_dataset(derived / "rock" / "observations.nc")["taken"].values
            rocks = len(taken) ** 2 / sum((taken == one).sum() for one in taken)
            assert f"number of rocks of {rocks:.3g} for {len(taken)} draws" in ran.err
