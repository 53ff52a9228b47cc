"""Every setting is in the keys of all that depends on it, whatever a stage declares.

The settings are those of the models; what each decides is stated here, in the words of the work
that is done: a rock is shaken, its runs make responses, these a fragility, and so on.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError

from pipeline import ROOT
from pipeline.config.layers import Site, load_site
from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.config.schema import Config
from pipeline.stages.mesh.products import Standing
from pipeline.stages.motions.motion_grid import MotionData
from pipeline.stages.runs import study
from pipeline.stages.runs.scenes import Scenes
from pipeline.stages.runs.step_choice import stored_steps
from pipeline.stages.studies.validation import recorded_runs, table_motions
from pipeline.workflow import graph, keys, pages, registry
from pipeline.workflow.parameters import Values
from pipeline.workflow.registry import BY_NAME, STAGES, settings_of
from pipeline.workflow.stage import Job, named
from pipeline.workflow.store import Store
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records.components import ComponentMotion
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.rock.solid import block
from vsr_core.source import tracing
from vsr_core.table.stepper import SteppedPulse, Stepper

# What depends on what

RUNS = {"runs", "responses", "boundary", "bullet_sample", "fragility", "report"}
MOVED = {"displacement_runs", "displacement", "displacement_report", "geodata", "model"}
DRAWN = {"observations", "uncertainty", "exclusion", "hazard"}
STUDIES = {"accuracy", "drive"}
AFTER_MOTIONS = RUNS | MOVED | DRAWN | STUDIES

DECIDES = {
    "rock": {"rock", "time_step", "terrain", "as_printed"} | AFTER_MOTIONS,
    "pedestal": {"rock", "time_step", "terrain", "as_printed"} | AFTER_MOTIONS,
    "contact": {"time_step", "terrain", "as_printed"} | AFTER_MOTIONS,
    "contact.rolling_friction": {"rock"},
    "motion": {"motions", "as_printed"} | AFTER_MOTIONS,
    "yaw": AFTER_MOTIONS,
    "drive": {"time_step", "accuracy"} | RUNS | DRAWN,
    "servo": {"time_step", "accuracy", "drive"} | RUNS | DRAWN,
    "simulation": {"time_step", "accuracy"} | RUNS | MOVED | DRAWN,
    "simulation.engine": {"terrain"},
    "simulation.reduce": {"terrain"},
    "fragility": {"boundary", "fragility", "report"} | DRAWN - {"observations"},
    "observed_boulder": {"displacement_report"},
    "georeference": {"geodata"},
    "hazard": {"hazard"},
    "hazard.age": {"exclusion"},
    "hazard.history": {"exclusion"},
    "hazard.minimum_survival_probability": {"exclusion"},
    "hazard.support": {"exclusion"},
    "hazard.faults": {"exclusion"},
    "hazard.ground_motion": {"exclusion"},
    "uncertainty": DRAWN,
    "uncertainty.inset": {"report"},
    "observations": DRAWN,
    "stability": {"stability"},
}
"""Stages whose products a setting decides, by the beginnings of dotted keys."""

NO_RUN = {
    "rock.mesh": "a block has no scan",
    "rock.fallback": "a block has no scan",
    "rock.scale": "a block has no scan",
    "rock.closing": "a block has no scan",
    "rock.contact_shape": "a block is its own hull",
    "rock.contact_error": "a block is its own hull",
    "pedestal.mesh": "level ground is in no file",
    "pedestal.fallback": "level ground is in no file",
    "pedestal.point_on_rock": "level ground is cut from no scan",
    "pedestal.seat": "a rock on level ground stands on its base",
    "simulation.tolerance": "it chooses a time step, which is given here",
    "simulation.keep": "less is kept of the same runs",
    "fragility": "it asks for runs between the cells of a grid",
    "observed_boulder": "it is asked of runs that are done",
    "georeference": "it tells where runs that are done were",
    "hazard": "it is asked of runs that are done",
    "uncertainty": "draws have runs of their own",
    "observations": "they weigh draws",
    "stability": "it has cases of its own",
}
"""Settings of a block on level ground that change no run on its grid, and why."""


# Configurations in which each setting counts


class Base(NamedTuple):
    """A configuration, the products that are asked for, and the key that it is there for.

    Other settings are changed in another configuration; in this one too, in the slow suite.
    """

    site: str
    products: tuple[str, ...]
    settings: tuple[str, ...] = ()
    about: str = ""


STEP = "simulation.time_step=0.001"
FLAT = ("report", "hazard", "accuracy", "drive", "as_printed")
ROCKS = "hazard.rocks=[{site: other, age: {kind: normal, mean: 1000, sd: 10}}]"
RATIO = "hazard.pgv_pga={pga: [0.1, 0.5], median: [0.1, 0.2], log_sd: [0.3, 0.4]}"
COMPARE = "hazard.compare=[{name: friction, study: friction, set: []}]"
ASKED = ("hazard.curves=curves", "hazard.age={kind: normal, mean: 10000, sd: 1000}")
HISTORY = "hazard.history=[{site: other, until: {kind: normal, mean: 1000, sd: 10}}]"
PULSES = "[{axis: x}, {axis: z, pga_ratio: 0.3, pgv_pga: 0.1}]"
OBSERVED = (
    "observations=[{kind: tilt, direction: 30, angle: 9.5, outcome: tipped, sd: 0.3}, "
    "{kind: push, direction: 30, force: 850, height: 1.2, outcome: lifted, sd: 40}, "
    "{kind: rocking, direction: 30, frequency: 1.9, amplitude: 0.5, sd: 0.1}, "
    "{kind: shake, motion: test7.csv, direction: 0, outcome: stood}, "
    "{kind: earthquake, year: 2003, pga: 0.22, pga_log_sd: 0.4, pgv: 18, pgv_log_sd: 0.4}]"
)
RECORD = (
    "{kind: record, files: [a.csv], pga: [0.1, 0.3], processing: {order: standard, highpass: 0.1, "
    "lowpass: 25.0}, response: {file: a.xml, corners: [0.1, 0.2, 20.0, 25.0]}}"
)


def on_terrain(cut: str = "proposal", about: str = "pedestal.cut") -> Base:
    settings = (STEP, f"pedestal.cut={cut}", "observed_boulder.deposit_area=1000.0")
    return Base("double_rock_terrain", ("displacement_report", "report"), settings, about)


def of_age(age: str) -> Base:
    settings = (STEP, "hazard.curves=curves", f"hazard.age={age}")
    return Base("cuboid_1x1x2", ("hazard",), settings, "hazard.age")


def shaken(motion: str) -> Base:
    products = ("report", "accuracy", "drive")
    return Base("cuboid_1x1x2", products, (STEP, f"motion={motion}"), "motion")


BASES = {
    "block": Base("cuboid_1x1x2", FLAT, (STEP, "rock.mesh=a.ply", *ASKED, ROCKS, RATIO, COMPARE)),
    "bullet": Base("cuboid_1x1x2", ("report",), (STEP, "simulation.engine=bullet")),
    "servo": Base("cuboid_1x1x2", ("report", "accuracy", "drive"), (STEP, "drive=servo")),
    "idle servo": Base("cuboid_1x1x2", ("drive",), (STEP,)),
    "terrain": on_terrain(about=""),
    "two files": Base("granite_boulder", ("displacement_report",), (STEP,), "rock.pose"),
    "plane": on_terrain("{kind: plane, point: [0, 0, 1], normal: [0, 0, 1]}"),
    "box": on_terrain("{kind: box, low: [0, 0, 0], high: [1, 1, 1]}"),
    "polygon": on_terrain("{kind: polygon, corners: [[0, 0], [1, 0], [0, 1]]}"),
    "colour": on_terrain("{kind: colour, rgb: [200, 10, 10]}"),
    "few points": Base(
        "double_rock_terrain",
        ("displacement_report",),
        (STEP, "pedestal.cut=proposal", "pedestal.seat={points: 3}"),
        "pedestal.seat",
    ),
    "map": Base(
        "double_rock_terrain",
        ("geodata", "model"),
        (STEP, "pedestal.cut=proposal", "georeference.crs=EPSG:32611"),
        "georeference",
    ),
    "observed": Base("cuboid_1x1x2", ("hazard",), (STEP, *ASKED, OBSERVED), "observations"),
    "events": Base(
        "cuboid_1x1x2",
        ("hazard",),
        (STEP, "hazard.events=events", "hazard.effective_time=1000.0", ASKED[1]),
        "hazard.e",
    ),
    "exhumed": Base("cuboid_1x1x2", ("hazard",), (STEP, *ASKED, HISTORY), "hazard.history"),
    "lognormal": of_age("{kind: lognormal, median: 10000, log_sd: 0.3}"),
    "bounds": of_age("{kind: bounds, low: 9000, high: 20000}"),
    "samples": of_age("{kind: samples, values: [9000, 10000]}"),
    "sine": shaken("{kind: sine_pulse, pga: [0.2, 0.4], pgv_pga: [0.1, 0.2]}"),
    "ricker": shaken("{kind: ricker_pulse, pga: [0.2, 0.4], pgv_pga: [0.1, 0.2]}"),
    "record": shaken(RECORD),
    "components": shaken(
        "{kind: record, records: [{file: a.mseed, components: {x: E, y: N, z: Z}, azimuth: 30}], "
        "pga: [0.1, 0.3], processing: {order: standard, highpass: 0.1, lowpass: 25.0}}"
    ),
    "table": shaken("{kind: table, files: [a.csv], pga: [0.1, 0.3]}"),
    "pulses": shaken(f"{{kind: table, pulses: {PULSES}, pga: [0.1, 0.3], pgv_pga: [0.1, 0.2]}}"),
}

GRIDS_OF_RUNS = ("block", "bullet", "servo", "sine", "ricker", "pulses")
"""Those whose runs are told by the configuration alone."""


@cache
def site_of(base: str) -> Site:
    given = BASES[base]
    return load_site(given.site, None, given.settings)


# Settings and other values of them


def leaves(model: BaseModel) -> Iterator[tuple[tuple[Any, ...], Any, tuple[str, str]]]:
    """Each setting of a configuration: its key in parts, its value, its model and name there."""
    for name in type(model).model_fields:
        value = getattr(model, name)
        parts = enumerate(value) if isinstance(value, tuple) else [(None, value)]
        models = [(at, part) for at, part in parts if isinstance(part, BaseModel)]
        for at, part in models:
            above = (name,) if at is None else (name, at)
            yield from (((*above, *key), found, leaf) for key, found, leaf in leaves(part))
        if not models:
            yield (name,), value, (type(model).__name__, name)


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from models_in(part)


def settings_in(model: type[BaseModel]) -> Iterator[tuple[str, str]]:
    """Model and name of every setting there is, but for kinds, which choose among models."""
    for name, field in model.model_fields.items():
        inner = list(models_in(field.annotation))
        one = get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1
        if not inner and not one:
            yield model.__name__, name
        for part in inner:
            yield from settings_in(part)


def set_to(model: Any, key: tuple[Any, ...], value: Any) -> Any:
    """The same with another value, checked as one of a file is."""
    if not key:
        return value
    if isinstance(model, tuple):
        return (*model[: key[0]], set_to(model[key[0]], key[1:], value), *model[key[0] + 1 :])
    inner = {name: getattr(model, name) for name in type(model).model_fields}
    return type(model).model_validate(inner | {key[0]: set_to(inner[key[0]], key[1:], value)})


def others(value: Any, name: str) -> Iterator[Any]:
    """Other values that a setting may have; those that it may not are refused."""
    if name == "engine":
        yield "bullet"
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield from (value + 1, value - 1)
    elif isinstance(value, float):
        yield from (1.1 * value, 0.9 * value, 0.5 * value, value + 0.1)
    elif isinstance(value, str):
        yield from ("servo", "energetic", "caps", "hull", "mesh", "flat", "paper", "larger", "yaw")
        yield "boundary"
        yield from ("stood", "tipped", "lifted", "toppled", "scan")
        yield f"{value}2"
    elif value:
        yield from ((*value[:-1], last) for last in others(value[-1], ""))
    yield from (None, "other", 0.5, 0.05, 100.0, (1.0, 2.0, 3.0), (0.0, 0.0, 0.6, 0.8), ("yaw=90",))
    yield ("peak_tilt",)


@dataclass(frozen=True)
class Change:
    """A configuration with one setting changed."""

    base: str
    key: tuple[Any, ...]
    leaf: tuple[str, str]
    config: Config

    @property
    def dotted(self) -> str:
        return ".".join(map(str, self.key))

    def among(self, keys: Any) -> bool:
        return any(f"{self.dotted}.".startswith(f"{key}.") for key in keys)


@cache
def changes() -> tuple[Change, ...]:
    found = []
    for base in BASES:
        config = site_of(base).config
        for key, value, leaf in leaves(config):
            for other in others(value, key[-1]):
                try:
                    changed = set_to(config, key, other)
                except ValidationError:
                    continue
                if other != value:
                    found.append(Change(base, key, leaf, changed))
                    break
    return tuple(found)


@pytest.mark.slow
def test_every_setting_is_changed_in_a_configuration_at_least() -> None:
    assert set(settings_in(Config)) - {change.leaf for change in changes()} == set()


# Keys


@pytest.fixture
def only_settings(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Keys without code, versions and files, which other tests are about."""
    monkeypatch.setattr(tracing, "reached", lambda roots: {})
    monkeypatch.setattr(keys, "installed_version", lambda name: "1")
    monkeypatch.setattr(graph, "_found", lambda path, site: None)
    monkeypatch.setattr(graph, "named", lambda path: lambda site: None)
    return monkeypatch


def stage_keys(base: str, config: Config) -> dict[str, str]:
    site = replace(site_of(base), settings=config)
    return {
        stage: identity.key
        for product in BASES[base].products
        for stage, identity in graph.identities(product, site).items()
    }


def quick_and_slow(bases: Iterable[str]) -> list[Any]:
    """Each configuration with the key that it is there for, and slow with all its keys."""
    all_keys = [(base, "") for base in bases]
    quick = [(base, BASES[base].about) for base in bases]
    slow = [pytest.param(*one, marks=pytest.mark.slow) for one in all_keys if one not in quick]
    return [*quick, *slow]


@pytest.mark.parametrize(("base", "about"), quick_and_slow(BASES))
def test_stages_change_with_every_setting_that_decides_them(
    only_settings: pytest.MonkeyPatch, base: str, about: str
) -> None:
    before = stage_keys(base, site_of(base).config)
    stale = {}
    changed = [one for one in changes() if one.base == base and one.dotted.startswith(about)]
    assert changed
    for change in changed:
        after = stage_keys(base, change.config)
        same = {stage for stage in before if after.get(stage) == before[stage]}
        wanted = set().union(*(DECIDES[key] for key in DECIDES if change.among((key,))))
        if change.key[0] == "servo" and change.config.drive != "servo":
            wanted &= {"drive"}  # it drives nothing else
        if left := wanted & same & before.keys():
            stale[change.dotted] = left
    assert stale == {}


@pytest.mark.parametrize("stage", [stage.name for stage in STAGES])
def test_what_leaves_the_key_of_a_stage_leaves_all_that_it_is_given(
    only_settings: pytest.MonkeyPatch, stage: str
) -> None:
    """A function is given what its key is made of: with the same key, the same."""
    asked = settings_of(BY_NAME[stage].make)
    for base in BASES:
        before = Values(site_of(base).config)
        for change in (one for one in changes() if one.base == base):
            after = Values(change.config)
            same = all(before.plain(key) == after.plain(key) for key in asked)
            assert same == all(before.given(key) == after.given(key) for key in asked), change.key


@pytest.mark.parametrize("stage", [stage.name for stage in STAGES])
def test_a_function_takes_what_is_read_off_its_text(stage: str) -> None:
    """Its parameters are those of the key; none of them is what holds all settings or products."""
    make = named(BY_NAME[stage].make)
    hints = get_type_hints(make)
    hints.pop("return")
    assert list(registry.asked(BY_NAME[stage].make).asked) == list(hints)
    assert not {Config, Site, Job, Store} & set(hints.values())


def run_keys(config: Config, folder: Path) -> tuple[set[bytes], set[bytes]]:
    """Keys of all runs on the grid of a block, and of their lines along PGA."""
    assert config.rock.size is not None
    nothing: Any = None
    scenes = Scenes(config.scene, Standing(block(config.rock.size, config.rock.density), nothing))
    steps, motions = stored_steps(scenes, folder), MotionData(folder)
    asked = study.Study(scenes, nothing, config.yaw, config.motion, motions, steps)
    cells = {run.key for group in asked.groups for run in asked.wanted(group)}
    return cells, {run.key for group in asked.groups for run in asked.lines(group)}


@pytest.mark.parametrize("base", GRIDS_OF_RUNS)
def test_runs_change_with_every_setting_but_those_that_cannot_count(
    only_settings: pytest.MonkeyPatch, tmp_path: Path, base: str
) -> None:
    before = run_keys(site_of(base).config, tmp_path)
    wrong = {}
    for change in (one for one in changes() if one.base == base):
        if change.config.rock.shape == "mesh":
            continue
        idle = change.among(NO_RUN) or (change.key[0] == "servo" and change.config.drive != "servo")
        idle |= change.leaf[1] == "engine" and change.config.engine == site_of(base).config.engine
        after = run_keys(change.config, tmp_path)
        same = [one == other for one, other in zip(before, after, strict=True)]
        if same != [idle, idle]:
            wrong[change.dotted] = same
    assert wrong == {}


def test_a_line_is_told_by_all_its_pga(only_settings: pytest.MonkeyPatch, tmp_path: Path) -> None:
    lines = []
    for pga in ("[0.2, 0.4, 0.6]", "[0.2, 0.5, 0.6]"):
        settings = (STEP, f"motion.pga={pga}", "motion.pgv_pga=[0.1, 0.2]")
        lines.append(run_keys(load_site("cuboid_1x1x2", None, settings).config, tmp_path)[1])
    assert not lines[0] & lines[1]


def test_pulses_of_other_shapes_and_axes_are_other_runs(
    only_settings: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    grid = "pga: [0.2, 0.4], pgv_pga: [0.1, 0.2]"
    kinds = ["cosine_pulse", "sine_pulse", "ricker_pulse"]
    motions = [f"{{kind: {kind}, {grid}}}" for kind in kinds]
    motions += [f"{{kind: table, pulses: [{{axis: {axis}}}], {grid}}}" for axis in ("x", "y", "z")]
    found = []
    for motion in motions:
        config = load_site("cuboid_1x1x2", None, (STEP, f"motion={motion}")).config
        found.append(run_keys(config, tmp_path)[0])
    assert len(set().union(*found)) == sum(map(len, found)) == 4 * len(motions)


@pytest.mark.parametrize("change", [{"density": 2600.0}, {"friction": 0.7}])
def test_runs_of_recorded_tests_change_with_what_they_are_of(change: dict[str, float]) -> None:
    draw = recorded_runs.Draw(1, recorded_runs.Role.BEST_GUESS)

    def told(density: float = 2700.0, friction: float = 0.6) -> str:
        tests = SimpleNamespace(config=ShakeTableConfig(density=density))
        arrays = {name: np.zeros(3) for name in ("vertices", "normals", "faces", "other")}
        series = SimpleNamespace(tests=tests, forms={1: SimpleNamespace(**arrays, spread=0.1)})
        drive = recorded_runs.Drive(draw, None)
        members = {drive: SimpleNamespace(friction=friction)}
        return recorded_runs._identities(series, members)[drive]

    assert told() == told()
    assert told(**change) != told()


def test_motions_of_tests_differ_in_all_that_they_are_of() -> None:
    def record(value: float = 0.1, interval: float = 0.005) -> RecordedMotion:
        return RecordedMotion(Trace(np.array([0.0, value, 0.0]), interval))

    pulse, motor = CosinePulse(1.0, 0.2), Stepper(200.0, 4e-5, 1e-4)
    every = [
        record(),
        record(value=0.2),
        record(interval=0.01),
        ComponentMotion((record(), record(), record(0.0))),
        ComponentMotion((record(), record(0.0), record())),
        pulse,
        SteppedPulse(pulse, motor),
        SteppedPulse(pulse, replace(motor, overhead=0.0)),
        SteppedPulse(CosinePulse(1.0, 0.1), motor),
    ]
    assert len({table_motions.identity(motion) for motion in every}) == len(every)
    assert table_motions.identity(record()) == table_motions.identity(record())


# Templates, and what is checked besides


def templates_in(room: str) -> set[str]:
    """Templates that the code of a room names, which are those of its pages."""
    trees = [ast.parse(path.read_bytes()) for path in (ROOT / room).glob("*.py")]
    texts = {n.value for tree in trees for n in ast.walk(tree) if isinstance(n, ast.Constant)}
    return {name for name in pages.texts() if name in texts and Path(name).suffix != ".yaml"}


@pytest.mark.slow
def test_pages_change_with_every_template_that_the_code_of_their_room_names(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pages, "digest", lambda name: "another text")
    changed: dict[str, set[str]] = {}
    for stage in STAGES:
        digests = graph.made_from(stage, {}, {}, {}).facts["inputs"]
        told = {name for name, digest in digests.items() if digest == "another text"}
        room = stage.make.rpartition(".")[0].replace(".", "/")
        changed[room] = changed.get(room, set()) | told
    unnoticed = {room: left for room in changed if (left := templates_in(room) - changed[room])}
    assert unnoticed == {}
    assert sum(map(bool, map(templates_in, changed))) > 6
