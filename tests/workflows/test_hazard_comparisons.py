"""Comparisons of a hazard: the rock with other settings or studies, as cases of its result."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Ran
from support.hazard_site import BOX, CURVES, GRID, HAZARD

from pipeline import cli
from pipeline.config.layers import load_site
from pipeline.stages.hazard import other_rocks


def test_a_setting_that_a_comparison_cannot_have_is_refused_by_its_name(
    refused: Callable[..., str],
) -> None:
    """The site shakes with pulses, which have PGV/PGA; its comparison with records has not."""
    one = "{name: recorded motions, study: records, set: ['motion.pgv_pga=[0.3]']}"
    setting = ("--set", f"hazard.compare=[{one}]", "--set", "motion.pgv_pga=[0.4]")
    words = ("recorded motions", "motion.pgv_pga", "--set hazard.compare=[]")
    line = refused("run", "hazard", "--site", "double_rock", *setting, words=words)
    assert "did you mean" not in line


@pytest.mark.slow
def test_curves_of_a_sweep_lie_beside_who_gives_them(
    vsr: Callable[..., Ran],
    write_site: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And not beside the site, where other curves have the same name."""
    (tmp_path / "study.yaml").write_text("sweep: {stood: {hazard.age.mean: [4000, 5000]}}\n")
    (tmp_path / "mine").mkdir()
    shutil.copytree(CURVES, tmp_path / "here" / "mine")
    monkeypatch.chdir(tmp_path / "here")
    site = write_site(BOX + GRID + "hazard: {age: {kind: normal, mean: 4000, source: none}}\n")
    given = ("hazard", "--site", site, "--study", tmp_path / "study.yaml", "--curves", "mine")
    ran = vsr("run", *given)
    assert ran.code == cli.DONE, ran.err
    assert ran.err.count("of 9 branches rejected") == 2


def test_a_hazard_is_swept_of_a_rock_alone(
    refused: Callable[..., str], write_site: Callable[..., str], tmp_path: Path
) -> None:
    (tmp_path / "study.yaml").write_text("sweep: {bounce: {contact.restitution: [0, 0.3]}}\n")
    site = write_site(BOX + GRID + HAZARD)
    given = ("run", "hazard", "--site", site, "--study", tmp_path / "study.yaml")
    refused(*given, words=("hazard.compare", "--set hazard.compare=[]"))


def test_a_comparison_that_changes_no_fragility_is_refused(
    refused: Callable[..., str], write_site: Callable[..., str]
) -> None:
    site = write_site(BOX + GRID + HAZARD)
    study = Path(site).with_name("young.yaml")
    study.write_text("hazard: {age: {mean: 999}}\n")
    for given, got in (
        ("set: [hazard.age.mean=999]", "hazard.age.mean"),
        ("set: [contact.friction=0.4 hazard.age.mean=999]", "hazard.age.mean"),
        (f"study: {study}", "hazard"),
    ):
        compare = f"hazard.compare=[{{name: young, {given}}}]"
        words = ("hazard.compare", f"got {got};", "another fragility")
        refused("run", "hazard", "--site", site, "--set", compare, words=words)
    twice = "hazard.compare=[{name: smooth, set: [contact.friction=0.4, contact.friction=0.8]}]"
    words = ("hazard.compare: smooth: contact.friction", "no setting replaces another")
    refused("run", "hazard", "--site", site, "--set", twice, words=words)


def test_a_study_that_is_compared_lies_beside_who_names_it_and_over_that_of_the_command(
    write_site: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another of its name lies in the current folder."""
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "mine.yaml").write_text("contact: {friction: 0.9}\n")
    (tmp_path / "mine.yaml").write_text("contact: {friction: 0.3}\n")
    (tmp_path / "given.yaml").write_text(
        "contact: {friction: 0.7, restitution: 0.2}\nhazard: {minimum_survival_probability: 0.1}\n"
    )
    age = "age: {kind: normal, mean: 4000, source: none}"
    site = write_site(f"{BOX}{GRID}hazard: {{{age}, compare: [{{name: a, study: mine.yaml}}]}}\n")
    monkeypatch.chdir(tmp_path / "here")
    own = load_site(site, str(tmp_path / "given.yaml"))
    (compared,) = other_rocks.find(own.config.hazard, own.origin).compared
    contact = compared.site.config.contact
    assert (contact.friction, contact.restitution) == ((0.3,), 0.2)
    assert own.config.contact.friction == (0.7,)


PULSES = "motion={kind: cosine_pulse, pga: [0.2, 0.4], pgv_pga: [0.3]}"
PROCESSED = "{order: none, highpass: null, lowpass: null}"
RECORDED = f"{{kind: record, files: waves, pga: [0.3], processing: {PROCESSED}}}"


@pytest.mark.parametrize(
    ("study", "settings", "compared", "kind", "friction", "without"),
    [
        ("", ("contact.friction=0.8",), "contact: {friction: 0.3}", "cosine_pulse", 0.3, ""),
        ("", (PULSES,), f"motion: {RECORDED}", "record", 0.6, ""),
        ("contact: {friction: 0.8}", (PULSES,), "motion: {pga: 0.5}", "cosine_pulse", 0.8, ""),
        (f"motion: {RECORDED}", (), "motion: {pga: 0.5}", "record", 0.6, ""),
        (
            *(f"motion: {RECORDED}", ("contact.friction=0.8",), "motion: {pgv_pga: 0.1}"),
            *("cosine_pulse", 0.8, "the motion of the command"),
        ),
        (
            *("contact: {friction: 0.7}", (f"motion={RECORDED}",), "motion: {pgv_pga: 0.1}"),
            *("cosine_pulse", 0.7, "the motion of the command"),
        ),
    ],
)
def test_a_study_that_is_compared_lies_over_all_of_the_command_that_it_goes_with(
    study: str,
    settings: tuple[str, ...],
    compared: str,
    kind: str,
    friction: float,
    without: str,
    write_site: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Pulses have PGV/PGA and records have files, so that keys of the one say nothing of others."""
    monkeypatch.chdir(tmp_path)
    Path("given.yaml").write_text(study)
    Path("mine.yaml").write_text(compared)
    age = "age: {kind: normal, mean: 4000, source: none}"
    site = write_site(f"{BOX}{GRID}hazard: {{{age}, compare: [{{name: a, study: mine.yaml}}]}}\n")
    own = load_site(site, "given.yaml" if study else None, settings)
    found = other_rocks.find(own.config.hazard, own.origin)
    (config,) = (one.site.config for one in found.compared)
    assert (config.motion.kind, config.contact.friction) == (kind, (friction,))
    if "{pga: 0.5}" in compared:
        assert config.motion.pga == (0.5,)
    told = f"mine.yaml does not go with {without}; compared without"
    assert [line.partition(": a: ")[2] for line in found.told] == [told] * bool(without)


def test_a_direction_in_radians_of_a_comparison_is_told(vsr: Callable[..., Ran]) -> None:
    compare = "hazard.compare=[{name: turned, set: [yaw=0.785]}, {name: east, set: [yaw=45]}]"
    ran = vsr("plan", "hazard", "--site", "double_rock", "--set", compare)
    assert ran.code == cli.DONE, ran.err
    assert "warning: --set: hazard.compare: turned: --set: yaw: got 0.785" in ran.err
    assert ran.err.count("warning: ") == 1


@pytest.mark.slow
def test_what_a_comparison_leaves_out_of_the_command_is_told_once(vsr: Callable[..., Ran]) -> None:
    compare = "hazard.compare=[{name: coarse, study: coarse_grid}]"
    ran = vsr("plan", "hazard", "--site", "double_rock", "--study", "records", "--set", compare)
    told = "warning: --set: hazard.compare: coarse: coarse_grid does not go with the motion of"
    assert (ran.code, ran.err.count(told)) == (cli.DONE, 1), ran.err
