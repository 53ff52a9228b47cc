"""Sweeps of a study: what they mean, and every refusal as one line with nothing written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.config.layers import STUDIES
from pipeline.config.sweep import MOST_MEMBERS, Sweep, load_sweep

Refused = Callable[..., str]
WriteSite = Callable[..., str]


@pytest.fixture
def sweep_of(write_site: WriteSite, tmp_path: Path) -> Callable[..., Sweep]:
    def load(text: str, *settings: str, gridded: bool = True, site: str = "") -> Sweep:
        study = tmp_path / "study.yaml"
        study.write_text(text)
        found = load_sweep(write_site(site), str(study), settings, gridded=gridded)
        assert found is not None
        return found

    return load


def test_members_are_all_combinations(sweep_of: Callable[..., Sweep]) -> None:
    found = sweep_of(
        "yaw: 45\nsweep:\n"
        "  bounce: {contact.restitution: {start: 0, stop: 0.4, num: 3}}\n"
        "  size: {rock.size: [[1, 1, 2], [2, 2, 4]], simulation.time_step: [0.001, 0.002]}\n"
    )
    assert found.study == "study"
    assert [member.place for member in found.members] == [(i, j) for i in range(3) for j in (0, 1)]
    last = found.members[-1]
    assert last.name == "bounce=0.4,size=2_x_2_x_4"
    config = last.site.config
    assert (config.contact.restitution, config.rock.size) == (0.4, (2.0, 2.0, 4.0))
    assert (config.simulation.time_step, config.yaw) == (0.002, (45.0,))
    bounce, size = found.dimensions
    assert (bounce.is_numeric, size.is_numeric) == (True, False)
    assert size.labels == ("1 x 1 x 2", "2 x 2 x 4")
    # restitution 0 is the site's own; none of the sizes is
    assert (bounce.reference, size.reference) == (0, 0)


def test_a_number_that_comes_again_is_a_name(sweep_of: Callable[..., Sweep]) -> None:
    """Beside another key a place has no number of its own to be found by."""
    keys = "rock.density: [2000, 2000, 2600], contact.restitution: [0, 0.2, 0.2]"
    (mass,) = sweep_of(f"sweep: {{mass: {{{keys}}}}}\n").dimensions
    assert mass.labels == ("2000 (1)", "2000 (2)", "2600")
    assert not mass.is_numeric


def test_directions_and_frictions_are_grids_of_one_member(sweep_of: Callable[..., Sweep]) -> None:
    text = "sweep:\n  yaw: {yaw: [0, 5, 10]}\n  mu: {contact.friction: [0.4, 0.6]}\n"
    found = sweep_of(text)
    (member,) = found.members
    assert member.site.config.yaw == (0.0, 5.0, 10.0)
    assert member.site.config.contact.friction == (0.4, 0.6)
    assert [one.reference for one in found.dimensions] == [0, 1]  # friction 0.6 is the site's own
    parted = sweep_of(text, gridded=False)
    assert len(parted.members) == 6
    assert parted.reference.site.config.contact.friction == (0.6,)


@pytest.mark.parametrize(
    ("site", "key", "values", "reference"),
    [
        ("cuboid_1x1x2", "hazard.minimum_survival_probability", "[0.01, 0.05]", 1),
        ("double_rock", "rock.closing", "[hull, caps]", 1),
        ("double_rock_terrain", "pedestal.seat", "[whole, rim]", 1),
        ("cuboid_1x1x2", "hazard.minimum_survival_probability", "[0.01, 0.02]", 0),
    ],
)
def test_the_reference_is_the_site_itself_also_by_a_value_it_leaves_out(
    site: str, key: str, values: str, reference: int, tmp_path: Path
) -> None:
    study = tmp_path / "study.yaml"
    study.write_text(
        f"sweep: {{e: {{simulation.reduce: [false, true]}}, it: {{{key}: {values}}}}}\n"
    )
    found = load_sweep(site, str(study), (), gridded=True)
    assert found is not None
    assert [one.reference for one in found.dimensions] == [1, reference]
    assert found.reference.place == (1, reference)


@pytest.mark.parametrize("gridded", [True, False])
def test_a_site_may_list_the_one_value_that_it_has(
    gridded: bool, sweep_of: Callable[..., Sweep]
) -> None:
    text = "sweep: {mu: {contact.friction: [0.4, 0.6]}, y: {yaw: [90, 0]}}\n"
    found = sweep_of(text, gridded=gridded, site="yaw: [0]\ncontact: {friction: [0.6]}\n")
    assert [one.reference for one in found.dimensions] == [1, 1]


def test_settings_hold_for_all_members(sweep_of: Callable[..., Sweep]) -> None:
    text = "sweep:\n  shape: {motion.kind: [cosine_pulse, ricker_pulse]}\n"
    found = sweep_of(text, "motion.pga.num=3", "yaw=7")
    kinds = [member.site.config.motion.kind for member in found.members]
    assert kinds == ["cosine_pulse", "ricker_pulse"]
    assert {member.site.config.motion.pga for member in found.members} == {(0.02, 0.51, 1.0)}
    assert {member.site.config.yaw for member in found.members} == {(7.0,)}


BAD = {
    "no dimension": ("sweep: {}", "sweep", "{}", "named dimensions"),
    "nothing": ("sweep: []", "sweep", "[]", "named dimensions"),
    "a name with a blank": ("sweep: {'my key': {yaw: [0, 1]}}", "lower-case letters", "rename"),
    "a dimension without keys": ("sweep: {yaw: [0, 1]}", "sweep.yaw", "keys of the configuration"),
    "lists of directions": ("sweep: {yaw: {yaw: [[0, 90], [30, 60]]}}", "sweep.yaw", "rename it"),
    "a list of frictions": (
        "sweep: {friction: {contact.friction: [[0.4, 0.6], 0.5]}}",
        "sweep.friction",
        "e.g. swept_friction",
    ),
    "no value": ("sweep: {yaw: {yaw: []}}", "sweep.yaw.yaw", "one value"),
    "an unknown key": ("sweep: {mu: {contact.fricton: [0.4]}}", "contact.fricton", "did you mean"),
    "an empty key": ("sweep: {mu: {contact..friction: [0.4]}}", "contact..friction", "invalid key"),
    "a wrong value": ("sweep: {mu: {contact.friction: [0.4, -1]}}", "contact.friction", "negative"),
    "a wrong value in one member": (
        "sweep: {e: {contact.restitution: [0, 0.1, 7]}}", "contact.restitution", "7", "expected",
    ),
    "a bad range": ("sweep: {y: {yaw: {start: 0, stop: 9, num: 0}}}", "sweep.y.yaw", "num"),
    "a key in two dimensions": (
        "sweep: {a: {yaw: [0, 1]}, b: {yaw: [2, 3]}}", "sweep.b.yaw", "sweep.a", "one dimension",
    ),
    "a key and its section": (
        "sweep: {a: {motion.kind: [sine_pulse]}, b: {motion: [{kind: sine_pulse}]}}",
        "sweep.b.motion", "motion.kind in sweep.a",
    ),
    "a key of the study itself": ("yaw: 3\nsweep: {yaw: {yaw: [0, 1]}}", "the study itself"),
    "values that repeat": ("sweep: {e: {contact.restitution: [0, 0.0]}}", "sweep.e", "0 twice"),
    "values of other numbers": (
        "sweep: {e: {contact.restitution: [0, 0.1], yaw: [0]}}", "sweep.e", "2 of", "1 of yaw",
    ),
    "too many members": (
        "sweep: {e: {contact.restitution: {start: 0, stop: 1, num: 500}}}", "500 members",
        str(MOST_MEMBERS),
    ),
    "a name of the datasets": (
        "sweep: {time_step: {simulation.time_step: [0.001]}}", "sweep.time_step", "study.nc",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
@pytest.mark.parametrize("verb", ["run", "plan"])
def test_bad_sweeps_are_refused(
    write_site: WriteSite, refused: Refused, tmp_path: Path, case: str, verb: str
) -> None:
    text, *words = BAD[case]
    study = tmp_path / "study.yaml"
    study.write_text(text)
    line = (verb, "study", "--site", write_site(), "--study", study)
    assert str(study) in refused(*line, words=tuple(words))


def test_a_setting_of_a_swept_key_is_refused(
    write_site: WriteSite, refused: Refused, tmp_path: Path
) -> None:
    study = tmp_path / "study.yaml"
    study.write_text("sweep: {yaw: {yaw: [0, 1]}}")
    line = ("run", "study", "--site", write_site(), "--study", study, "--set", "yaw=4")
    refused(*line, words=("sweep.yaw.yaw", "a setting"))


def test_a_study_without_a_sweep_is_a_layer_only(write_site: WriteSite, refused: Refused) -> None:
    site = write_site()
    refused("run", "study", "--site", site, words=("--study", "no study given"))
    line = ("run", "study", "--site", site, "--study", STUDIES / "records.yaml")
    refused(*line, words=("has no sweep",))
    line = ("prep", "--site", site, "--study", "friction")
    refused(*line, words=("sweep", "no sweep"))
