"""Layers of configuration, grids, and every refusal as one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.config.hazard_schema import SampledAge
from pipeline.config.layers import BASE, SITES, known, load_site
from pipeline.config.sections import Range
from pipeline.config.yaml_text import parse

Refused = Callable[..., str]
WriteSite = Callable[..., str]


def test_later_layers_win(write_site: WriteSite, tmp_path: Path) -> None:
    site = write_site("contact: {friction: 0.41, restitution: 0.11}\nyaw: 17\n")
    study = tmp_path / "study.yaml"
    study.write_text("contact: {friction: 0.42}\nyaw: [5, 6]\n")
    base = load_site(write_site("", "plain")).config
    only_site = load_site(site).config
    assert base.contact.friction == (0.6,)  # stated in base.yaml, after the paper
    assert only_site.contact.friction == (0.41,)
    assert only_site.contact.restitution == 0.11
    assert only_site.contact.rolling_friction == base.contact.rolling_friction
    assert only_site.motion == base.motion
    with_study = load_site(site, str(study)).config
    assert with_study.contact.friction == (0.42,)
    assert with_study.contact.restitution == 0.11
    assert with_study.yaw == (5.0, 6.0)
    last = load_site(site, str(study), ("contact.friction=0.43", "contact.friction=0.44")).config
    assert last.contact.friction == (0.44,)
    assert last.yaw == (5.0, 6.0)


def test_ages_of_another_rock_are_beside_the_file_that_names_them(
    write_site: WriteSite, tmp_path: Path
) -> None:
    for folder, age in ((tmp_path, 500), (tmp_path / "studies", 20_000)):
        folder.mkdir(exist_ok=True)
        (folder / "ages.csv").write_text(f"age_a\n{age}\n")
    own = "{site: double_rock, age: {kind: samples, file: ages.csv}}"
    study = tmp_path / "studies" / "study.yaml"
    study.write_text(f"hazard: {{age: {{kind: samples, file: ages.csv}}, rocks: [{own}]}}\n")
    hazard = load_site(write_site(""), str(study)).config.hazard
    ages = [age.values for age in (hazard.age, hazard.rocks[0].age) if isinstance(age, SampledAge)]
    assert ages == [(20_000.0,)] * 2


def test_part_of_a_range_is_overridden(write_site: WriteSite) -> None:
    site = write_site("motion: {pga: {start: 0.1, stop: 0.5, num: 5}}\n")
    assert load_site(site).config.motion.pga == (0.1, 0.2, 0.3, 0.4, 0.5)
    changed = load_site(site, None, ("motion.pga.num=3",)).config.motion.pga
    assert changed == (0.1, 0.3, 0.5)


def test_a_list_replaces_a_range_and_a_range_a_list(write_site: WriteSite) -> None:
    site = write_site("motion: {pga: [0.3, 0.7]}\n")
    assert load_site(site).config.motion.pga == (0.3, 0.7)
    changed = load_site(site, None, ("motion.pga={start: 0.2, stop: 0.4, num: 2}",)).config
    assert changed.motion.pga == (0.2, 0.4)


@pytest.mark.parametrize(
    ("given", "values"),
    [
        ("30", (30.0,)),
        ("[0, 90]", (0.0, 90.0)),
        ("[90, 0]", (90.0, 0.0)),
        ("{start: 0, stop: 90, num: 4}", (0.0, 30.0, 60.0, 90.0)),
        ("{start: 7, stop: 7, num: 1}", (7.0,)),
    ],
)
def test_scalars_lists_and_ranges_become_dimensions(
    write_site: WriteSite, given: str, values: tuple[float, ...]
) -> None:
    assert load_site(write_site(), None, (f"yaw={given}",)).config.yaw == values


@pytest.mark.parametrize("step", [0.02, 0.01, 0.03, 0.07, 0.15])
def test_widening_shares_values_exactly(step: float) -> None:
    narrow = Range(start=step, stop=step * 25, num=25).values()
    for more in (26, 49, 50, 97, 200):
        wide = Range(start=step, stop=step * more, num=more).values()
        assert wide[:25] == narrow
    finer = Range(start=step, stop=step * 25, num=49).values()
    assert finer[::2] == narrow
    shifted = Range(start=step * 5, stop=step * 30, num=26).values()
    assert shifted[:21] == narrow[4:]


def test_values_are_what_one_would_write() -> None:
    assert Range(start=0.1, stop=0.9, num=9).values() == tuple(i / 10 for i in range(1, 10))


CHERT, WOOD = 2110.0, 1500.0  # kg/m3, the paper's sections 4.2 and 5.1
PRINTS = {"petg_12.8cm": (0.128, 1240.0), "pla_12cm": (0.12, 1250.0)}  # m, kg/m3, section 4.3


@pytest.mark.parametrize("name", known())
def test_shipped_sites(name: str) -> None:
    config = load_site(name).config
    on_terrain = name in ("double_rock_terrain", "granite_boulder", "granite_dells")
    assert config.pedestal.shape == ("mesh" if on_terrain else "flat")
    assert config.contact.friction == (0.6,)
    assert len(config.motion.pgv_pga) == 50
    if name in PRINTS:
        height, density = PRINTS[name]
        assert config.rock.scale * 1.5085 == pytest.approx(height, abs=1e-5)  # of the rock
        assert config.rock.density == density
        assert config.rock.fallback == "double_rock"
        assert config.motion.pga[-1] == 1.2  # g, of the mini shake robot
        return
    assert len(config.motion.pga) == 50
    if name.startswith("cuboid_"):
        size = tuple(float(side) for side in name.removeprefix("cuboid_").split("x"))
        assert config.rock.size == size
        assert config.rock.density == CHERT
        assert config.motion.pga[::49] == config.motion.pgv_pga[::49] == (0.01, 1.0)
    elif name.startswith("w2_"):
        height = float(name.removeprefix("w2_").removesuffix("cm")) / 100.0
        assert config.rock.size is not None
        assert config.rock.size == pytest.approx((height / 5, height / 5, height))
        assert config.rock.density == WOOD
        assert config.motion.pga[::49] == (0.05, 0.5)
        assert config.motion.pgv_pga[::49] == (0.05, 0.35)
    elif name == "granite_boulder":
        assert config.on_own_ground
        assert config.rock.fallback is None  # without the boulder there is no such site
        assert config.rock.pose is not None
    elif on_terrain:
        assert config.rock.fallback == name
        assert config.pedestal.cut == "proposal"
    else:
        assert name == "double_rock"
        assert config.rock.density == CHERT
        assert config.yaw == tuple(30.0 * i for i in range(12))
        assert config.motion.pga[::49] == config.motion.pgv_pga[::49] == (0.02, 1.0)


def test_the_seven_sites_of_the_paper_are_shipped() -> None:
    cuboids = {f"cuboid_{size}" for size in ("1x1x2", "0.5x0.5x1", "1x1x3", "1x2x3")}
    assert cuboids | {"double_rock", "w2_5.5cm", "w2_55cm"} <= set(known())
    assert BASE.is_file()
    assert SITES.is_dir()


# What is wrong, and words that its line must hold: key, given, rule, remedy.
WRONG = {
    "negative friction": (
        "contact: {friction: -1}",
        "contact.friction",
        "-1",
        "must not be",
        "0.6",
    ),
    "one negative of two": ("contact: {friction: [0.4, -0.1]}", "contact.friction", "-0.1"),
    "misspelt": ("contact: {fricton: 0.4}", "contact.fricton", "unknown", "did you mean friction?"),
    "misspelt section": ("contct: {friction: 1}", "contct", "unknown", "did you mean contact?"),
    "misspelt in range": ("motion: {pga: {strat: 1}}", "motion.pga.strat", "did you mean start?"),
    "far off": ("zebra: 1", "zebra", "unknown", "the keys here are rock, pedestal"),
    "empty list": ("yaw: []", "yaw", "got []", "at least one"),
    "empty pga": ("motion: {pga: []}", "motion.pga", "got []", "at least one"),
    "no points": ("motion: {pga: {num: 0}}", "motion.pga.num", "got 0", "greater"),
    "percent": (
        "motion: {pga: {start: 2, stop: 100, num: 5}}",
        "motion.pga",
        "100",
        "in g",
        "0.3 for",
    ),
    "m/s2": ("motion: {pga: [9.81, 19.62]}", "motion.pga", "19.62", "in g", "0.3 for"),
    "pga of zero": ("motion: {pga: {start: 0}}", "motion.pga", "positive", "start above 0"),
    "ms": ("motion: {pgv_pga: [100, 300]}", "motion.pgv_pga", "300", "seconds", "0.3 for"),
    "descending": ("motion: {pga: [0.3, 0.1]}", "motion.pga", "[0.3, 0.1]", "ascend", "sort"),
    "repeated": ("yaw: [0, 90, 0]", "yaw", "[0, 90, 0]", "duplicate", "once"),
    "one way twice": ("yaw: [0, 90, 360]", "yaw", "0 and 360", "once", "leave one out"),
    "around": ("yaw: [270, -90]", "yaw", "-90", "270", "once"),
    "yaw": ("yaw: [0, 700]", "yaw", "700", "-360 to 360"),
    "text": ("contact: {friction: rough}", "contact.friction", "'rough'", "number"),
    "no as number": ("contact: {friction: no}", "contact.friction", "'no'", "number"),
    "sexagesimal": ("yaw: 1:30", "yaw", "'1:30'", "number"),
    "nan": ("contact: {friction: .nan}", "contact.friction", "nan", "finite"),
    "infinite": ("rock: {shape: box, size: [1, 1, 2], density: .inf}", "rock.density", "inf"),
    "nothing": ("yaw:", "yaw", "None"),
    "section of one number": ("contact: 3", "contact", "3"),
    "engine": ("simulation: {engine: havok}", "simulation.engine", "'havok'", "'bullet'"),
    "energetic in Bullet": (
        "contact: {restitution_law: energetic}\nsimulation: {engine: bullet}",
        "contact.restitution_law",
        "got energetic with simulation.engine: bullet;",
        "nonsmooth",
        "set newton",
    ),
    "energetic on a servo": (
        "contact: {restitution_law: energetic}\ndrive: servo",
        "contact.restitution_law",
        "got energetic with drive: servo;",
        "nonsmooth",
        "set newton",
    ),
    "energetic that rolls": (
        "contact: {restitution_law: energetic, rolling_friction: 0.001}",
        "contact.restitution_law",
        "got energetic with contact.rolling_friction: 0.001;",
        "set newton",
    ),
    "travels nowhere": (
        "simulation: {accurate: [boundary, trajectory]}",
        "simulation.accurate",
        "pedestal.shape: mesh",
        "leave out",
    ),
    "accurate in what": ("simulation: {accurate: [tilt]}", "simulation.accurate", "'peak_tilt'"),
    "coarse step": ("simulation: {time_step: 1}", "simulation.time_step", "0.02"),
    "box without size": ("rock: {shape: box, density: 2000}", "rock", "needs `size`", "[x, y, z]"),
    "mesh without path": ("rock: {shape: mesh, density: 2000}", "rock", "needs `mesh`", "path"),
    "flat box": ("rock: {shape: box, size: [1, 0, 2], density: 2000}", "rock.size", "positive"),
    "no density": ("rock: {shape: box, size: [1, 1, 2]}", "rock.density", "required", "kg m-3"),
    "g per cm3?": ("rock: {shape: box, size: [1, 1, 2], density: 0}", "rock.density", "0"),
    "key is a number": ("contact: {1: 3}", "contact.1", "unknown", "the keys here are friction"),
    "range key is a number": ("motion: {pga: {1: 3}}", "motion.pga.1", "unknown", "start"),
    "list as a key": ("? [a, b]\n: 3", "is no name", "correct the file"),
    "tab": ("contact:\n\tfriction: 1", "invalid YAML", "line 3", "correct the file"),
    "open bracket": ("yaw: [0, 30", "invalid YAML", "correct the file"),
    "key twice": ("yaw: 1\ncontact: {restitution: 0}\nyaw: 2", "'yaw' twice", "line 4", "correct"),
    "nested key twice": ("contact: {friction: 1, friction: 2}", "'friction' twice", "correct"),
    "python object": (
        "yaw: !!python/object/apply:os.getpid []",
        "invalid YAML",
        "correct the file",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_site_is_one_line(write_site: WriteSite, refused: Refused, case: str) -> None:
    text, *words = WRONG[case]
    site = write_site(text)
    for command in (("run", "responses", "--workers", "0"), ("plan",), ("why",), ("status",)):
        refused(*command, "--site", site, words=(site, *words))


def test_all_problems_are_told_at_once(write_site: WriteSite, vsr: Callable[..., object]) -> None:
    site = write_site("contact: {friction: -1, zebra: 3}\nyaw: []\n")
    ran = vsr("run", "responses", "--site", site)
    assert ran.code == 2
    lines = ran.err.splitlines()
    assert len(lines) == 3
    for key in ("contact.friction", "contact.zebra", "yaw"):
        assert sum(f": {key}: " in line for line in lines) == 1


def test_problem_names_the_layer_it_came_from(
    write_site: WriteSite, refused: Refused, tmp_path: Path
) -> None:
    site = write_site("yaw: 10")
    study = tmp_path / "study.yaml"
    study.write_text("yaw: 800\n")
    refused("why", "--site", site, "--study", study, words=(f"{study}: yaw", "800"))
    said = refused("why", "--site", site, "--set", "yaw=900", words=("--set: yaw", "900"))
    assert site not in said


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("yaw", ("'yaw'", "key=value")),
        ("=3", ("'=3'", "key=value")),
        ("yaw=[0,", ("yaw", "'[0,'", "YAML")),
        ("motion.pga.nmu=3", ("motion.pga.nmu", "did you mean num?")),
        ("contact.friction=-1", ("contact.friction", "-1", "0.6")),
        ("a.b=1", ("a", "unknown", "the keys here are")),
        ("contact={friction:0.4}", ("contact.friction:0.4: unknown", "a blank after its colon")),
        ("motion.pga={start:1}", ("motion.pga.start:1: unknown", "a blank after its colon")),
        ("uncertainty=1 uncertainty.members=5", ("uncertainty.members: got uncertainty",)),
        (
            "motion={kind: record, files: [a.mseed], unit: gal, pga: 0.3, "
            "response: {file: a.xml, corners: [1, 2, 20, 30]}, "
            "processing: {order: none, highpass: null, lowpass: null}}",
            ("motion.unit", "no unit goes with it", "leave out motion.unit"),
        ),
        ("yaw=30 yaw=60", ("--set: yaw: got yaw before it", "no setting replaces another")),
        ("motion.pga.num=3 motion.pga=[0.1]", ("motion.pga: got motion.pga.num before it",)),
        ("motion.pga=[0.1] motion.pga={start: 0.1}", ("motion.pga.start: got motion.pga before",)),
        (
            "motion.pga=0.3 motion={kind: record, files: a.mseed}",
            ("--set: motion: got motion.pga before it", "set the whole before its parts"),
        ),
        ("motion.files=a", ("motion.files", "only motion.kind record, table has this key")),
    ],
)
def test_wrong_setting(
    write_site: WriteSite, refused: Refused, setting: str, words: tuple[str, ...]
) -> None:
    refused("why", "--site", write_site(), "--set", setting, words=("--set", *words))


def test_a_number_for_a_section(write_site: WriteSite, refused: Refused) -> None:
    """A setting below it would take its place."""
    site = write_site("uncertainty: 1\n")
    words = (f"{site}: uncertainty: got 1", "it is a section of keys")
    refused("why", "--site", site, "--set", "uncertainty.members=5", words=words)


def test_unknown_site_lists_the_known(refused: Refused) -> None:
    said = refused("run", "responses", "--site", "double_rok", words=("'double_rok'", *known()))
    assert "did you mean double_rock?" in said
    refused("why", "--site", "zzz", words=("--site", "'zzz'", *known()))
    refused("why", "--site", "missing.yaml", words=("missing.yaml", "file not found", "path"))


def test_unknown_study(write_site: WriteSite, refused: Refused) -> None:
    refused("why", "--site", write_site(), "--study", "zzz", words=("--study", "'zzz'"))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"- a\n- b\n", ("a list", "mapping", "key: value")),
        (b"hello\n", ("a str", "mapping")),
        (b"\xff\xfe\x00\x01", ("not in UTF-8", "save it so")),
        (b"", ("an empty file", "remove the file")),
    ],
)
def test_file_that_is_no_configuration(
    tmp_path: Path, refused: Refused, content: bytes, words: tuple[str, ...]
) -> None:
    site = tmp_path / "odd.yaml"
    site.write_bytes(content)
    refused("why", "--site", site, words=(str(site), *words))


@pytest.mark.parametrize("workers", ["-1", "two", "1.5"])
def test_wrong_workers(write_site: WriteSite, refused: Refused, workers: str) -> None:
    refused(
        "run", "rock", "--site", write_site(), f"--workers={workers}", words=("--workers", workers)
    )


def test_numbers_mean_what_they_look_like(write_site: WriteSite) -> None:
    text = "contact: {friction: 1e-3, restitution: 5E-1}\nyaw: [000, 030, 060, 090, +12, -.5]\n"
    config = load_site(write_site(text)).config
    assert config.contact.friction == (0.001,)
    assert config.contact.restitution == 0.5
    assert config.yaw == (0.0, 30.0, 60.0, 90.0, 12.0, -0.5)


@pytest.mark.parametrize(
    "value",
    ["!!timestamp x", "!!bool x", '!!float ""', "!!float a", "!!str 30", "!!set {a, b}", "!a 3"],
)
def test_a_tag_makes_of_a_value_nothing_else(value: str) -> None:
    with pytest.raises(ValueError, match=r"a value that is no .* has that tag, line 1"):
        parse(value)


def test_a_tag_that_says_what_a_value_is_may_stand_there() -> None:
    assert parse("[!!int 3, !!float 1.0, !!str a, !!str '3', !!map {a: !!null ~}]") == [
        3, 1.0, "a", "3", {"a": None},
    ]  # fmt: skip
    with pytest.raises(ValueError, match="no timestamp"):
        parse("%TAG ! tag:yaml.org,2002:\n---\n!timestamp x")


@pytest.mark.parametrize("given", ["off", "no", "false", "False"])
def test_switches(write_site: WriteSite, given: str) -> None:
    assert (
        load_site(write_site(f"simulation: {{reduce: {given}}}")).config.simulation.reduce is False
    )
    setting = f"simulation.reduce={given}"
    assert load_site(write_site(), None, (setting,)).config.simulation.reduce is False
    assert load_site(write_site()).config.simulation.reduce is True


def test_pulses_of_another_shape_keep_their_peaks(write_site: Callable[..., str]) -> None:
    site = write_site("motion: {pga: [0.1, 0.7], pgv_pga: 0.3}")
    motion = load_site(site, None, ("motion.kind=ricker_pulse",)).config.motion
    assert (motion.kind, motion.pga) == ("ricker_pulse", (0.1, 0.7))
