"""The stiff and extreme cases: their verdicts, what is refused, and that the suite can fail."""

from __future__ import annotations

import csv
import math
import types
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.config.layers import load_site
from pipeline.drawing.style import pictures
from pipeline.stages.studies import stability as stage
from pipeline.stages.studies.stability import stability_map
from pipeline.workflow import graph
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.registry import BY_NAME
from pipeline.workflow.stage import Job
from pipeline.workflow.store import Store
from vsr_core import GRAVITY, engines
from vsr_core.arrays import Array
from vsr_core.engines.bullet import BulletWorld, collision_shapes
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import Barrier, barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome, Response
from vsr_core.rock.body import Rock
from vsr_core.run import input_checks
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.loop import HALVINGS
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene, State
from vsr_core.source import tracing
from vsr_core.table.servo import PUBLISHED
from vsr_core.verification import modules, stability
from vsr_core.verification.reference._run import slope
from vsr_core.verification.rocks import box, frustum, leaning, unit, upright
from vsr_core.verification.stability import ExtremeCase, Measured, Verdict

ALL = stability.cases()

QUICK = {
    "published gains at 1 kHz": Verdict.RIGHT,
    "published gains at 200 Hz": Verdict.FLAGGED,
    "hold 1.99 ms": Verdict.RIGHT,
    "hold 2 ms": Verdict.FLAGGED,
    "rock / table 100": Verdict.RIGHT,
    "sinking at 1e+06 N/m": Verdict.FLAGGED,
    "sinking at 1e+10 N/m": Verdict.RIGHT,
    "landing at 1e+08 N/m, damping 0": Verdict.RIGHT,
    "landing at 2 of the longest step": Verdict.FLAGGED,
    "springs under a hull": Verdict.FLAGGED,
    "1:20 in bullet": Verdict.RIGHT,
    "box of 0.01 m": Verdict.RIGHT,
    "1:100 in bullet": Verdict.FLAGGED,
    "needle on 200 mm in bullet": Verdict.RIGHT,
    "knife edge at a step of 0.006": Verdict.FLAGGED,
    "PGA 3 g": Verdict.RIGHT,
    "PGV/PGA 0.005 s at 3 g": Verdict.RIGHT,
    "a hole of 50 samples": Verdict.FLAGGED,
    "a hole, unchecked in bullet": Verdict.FLAGGED,
    "a spike of 50 g": Verdict.RIGHT,
    "20000 samples a second": Verdict.RIGHT,
    "sliding at 0.3 in bullet": Verdict.RIGHT,
    "sliding before rocking at 0.4 in mujoco": Verdict.FLAGGED,
    "box over triangles of 0.5 m in bullet": Verdict.RIGHT,
    "hull over triangles of 0.25 m in bullet": Verdict.RIGHT,
    "slab at 2.6 g in mujoco": Verdict.RIGHT,
    "rebound at 1": Verdict.RIGHT,
    "rebounds that add energy": Verdict.FLAGGED,
    "dropped by 10 radii in bullet": Verdict.RIGHT,
    "0.05 radii inside the pedestal in bullet": Verdict.FLAGGED,
    "needle at rest": Verdict.RIGHT,
    "swing of 1:2 at 0.1 in bullet": Verdict.FLAGGED,
    "swing of 1:2 at 0.001 in bullet": Verdict.RIGHT,
    "fall at 0.008 in bullet": Verdict.RIGHT,
    "step 33.3 ms, rigid": Verdict.FLAGGED,
    "step 0.1 ms, 1e+08 N/m": Verdict.RIGHT,
}


def test_the_list_is_covered() -> None:
    assert len(ALL) >= 70
    assert {case.family for case in ALL.values()} == set(stability.families())
    assert len(stability.families()) >= 13
    assert all(stability.families().values())
    assert all(name == case.name for name, case in ALL.items())
    assert len(ALL) == sum(len(module.CASES) for module in modules(stability.__name__).values())
    points = _module("stiffness_map").POINTS.values()
    assert len({h for h, _ in points}) >= 8
    assert len({k for _, k in points}) >= 7
    assert (max(h for h, _ in points), min(h for h, _ in points)) == (1 / 30, 1e-5)


@pytest.mark.parametrize("name", QUICK)
def test_verdict(name: str) -> None:
    found = ALL[name].run()
    assert found.verdict is QUICK[name], found
    if found.verdict is Verdict.FLAGGED:
        assert found.note.count("; ") >= 2  # what was given; the rule; the remedy


@pytest.mark.slow
@pytest.mark.parametrize("family", stability.families())
def test_no_case_is_silently_wrong(family: str) -> None:
    found = {name: case.run() for name, case in ALL.items() if case.family == family}
    assert {n: f for n, f in found.items() if f.verdict is Verdict.WRONG} == {}
    assert any(finding.verdict is Verdict.RIGHT for finding in found.values())


def test_the_published_gains_at_200_hz_are_refused_with_the_number_and_the_longest_period() -> None:
    note = ALL["published gains at 200 Hz"].run().note
    assert "Kp h / M = 5 " in note
    assert "periods below 1.998 ms" in note


# The suite can fail


def _lighter(world: BulletWorld, acceleration: Iterable[float]) -> None:
    """A tenth of gravity is missing."""
    world._weight *= 0.9
    try:
        _ADVANCE(world, acceleration)
    finally:
        world._weight /= 0.9


_ADVANCE = BulletWorld.advance


def _frozen(world: BulletWorld, acceleration: Iterable[float]) -> None:
    """Nothing ever moves."""


@pytest.mark.parametrize(
    ("advance", "seen_by"),
    [
        (_lighter, ("fall at 0.008 in bullet", "1:2 in bullet", "sinking at 1e+10 N/m")),
        (_frozen, ("fall at 0.008 in bullet", "rebound at 1", "PGA 1 g", "1:2 in bullet")),
    ],
)
def test_a_broken_engine_is_silently_wrong(
    monkeypatch: pytest.MonkeyPatch, advance: Callable[..., None], seen_by: tuple[str, ...]
) -> None:
    monkeypatch.setattr(BulletWorld, "advance", advance)
    for name in seen_by:
        assert ALL[name].run().verdict is Verdict.WRONG, name


@pytest.mark.parametrize("error", [math.nan, math.inf, 0.011])
def test_an_error_beyond_the_tolerance_is_wrong(error: float) -> None:
    assert _case(error).run().verdict is Verdict.WRONG
    assert _case(0.01).run().verdict is Verdict.RIGHT


def _case(error: float) -> ExtremeCase:
    return ExtremeCase("made up", "x", 1.0, "1", "nothing", 0.01, lambda: Measured(1.0, 1.0, error))


# The stage


def test_cases_of_one_scan_are_measured_in_one_process() -> None:
    order = [name for name, case in ALL.items() if case.family in ("raw_scans", "sliding")]
    batches = [batch.items for batch in stage._batches(order, ALL)]
    assert [name for batch in batches for name in batch] == order
    scans = _module("raw_scans").FIELDS
    assert len(scans) == 24
    together = [{name.partition(":")[0] for name in batch} for batch in batches if len(batch) > 2]
    assert together == [{scan} for scan in scans]


@pytest.fixture
def make_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Run the stage on some cases; returns the folder of its products."""

    def make(cases: dict[str, ExtremeCase], expected: int = 0) -> Path:
        monkeypatch.setattr(stability, "cases", lambda: cases)
        store = Store(tmp_path / f"products-{len(cases)}")
        store.open()
        job = Job(load_site("cuboid_1x1x2"), store, Cluster(0), lambda line: None)
        assert graph.make("stability", job) == expected
        return store.folder

    return make


@pytest.mark.slow
def test_products(make_stage: Callable[..., Path]) -> None:
    chosen = {name: ALL[name] for name in list(QUICK)[:8]}
    chosen |= {
        name: ALL[name]
        for name, (step, _) in _module("stiffness_map").POINTS.items()
        if step > 5e-3
    }
    folder = make_stage(chosen)
    with (folder / stage.TABLE).open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(chosen) >= 20
    assert list(rows[0]) == [
        "case", "family", "parameter", "value", "unit", "verdict", "measured", "expected", "error",
        "tolerance", "note",
    ]  # fmt: skip
    assert {row["verdict"] for row in rows} == {"right", "flagged"}
    assert all(row["note"].count("; ") >= 2 for row in rows if row["verdict"] == "flagged")
    for row in rows:
        if row["verdict"] == "right":
            assert float(row["error"]) <= float(row["tolerance"])
    page = (folder / stage.PAGE).read_text(encoding="utf-8")
    assert "No case is silently wrong." in page
    assert "http" not in page.replace("http://www.w3.org", "").replace("https://matplotlib", "")
    assert (folder / "stability_map.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "stability_map.pdf").read_bytes().startswith(b"%PDF")


def test_a_wrong_case_is_counted_and_shown(make_stage: Callable[..., Path]) -> None:
    chosen = {
        name: ALL[name] for name, (h, _) in _module("stiffness_map").POINTS.items() if h > 5e-3
    }
    broken = replace(ALL["step 33.3 ms, rigid"], measure=_case(math.inf).measure)
    folder = make_stage(chosen | {broken.name: broken}, expected=1)
    assert "1 silently wrong" in (folder / stage.PAGE).read_text(encoding="utf-8")


def test_figures_are_the_same_bytes_every_time(tmp_path: Path) -> None:
    points = pd.DataFrame(
        _module("stiffness_map").POINTS.values(), columns=["time_step", "stiffness"]
    )
    points["verdict"] = "flagged"
    made = []
    for _ in range(2):
        figure = stability_map(points, _module("stiffness_map").limits())
        for name, write in pictures("map", figure).items():
            write(tmp_path / name)
        made.append([(tmp_path / name).read_bytes() for name in ("map.png", "map.pdf")])
    assert made[0] == made[1]


def test_an_edit_of_a_case_makes_the_stage_again() -> None:
    made = BY_NAME["stability"]
    reached = tracing.reached([made.make, *made.code])
    for name in (
        "vsr_core.verification.stability.servo_gains:_tracks",
        "vsr_core.verification.stability.long_rest:_drift",
        "vsr_core.run.input_checks:check",
        "vsr_core.run.overturning:simulate",
        "vsr_core.engines.bullet.driven:BulletDrivenWorld",
        "vsr_core.engines.mujoco:SLIDING_SHARE",
        "vsr_core.run.rocking_block:rocking_response",
    ):
        assert name in reached, name


# Before a run


@cache
def _limits(rock: Rock) -> Barrier:
    return barrier(rock)


BLOCK = box(1.0, 1.0, 2.0)
PULSE = CosinePulse.from_g(0.8, 0.3)


def _check(
    contact: Contact = Contact(0.6),  # noqa: B008 (frozen)
    rock: Rock = BLOCK,
    share: float = 0.002,
    engine: str = "bullet",
    motion: CosinePulse = PULSE,
    **scene: object,
) -> None:
    described = Scene(rock, contact, **scene)  # type: ignore[arg-type]
    case = prepare(described, _limits(rock), reduce=True)
    input_checks.check(case, Settings(share * unit(rock), engine=engine), motion)


def test_what_is_fine_is_not_refused() -> None:
    _check()
    _check(engine="mujoco")
    _check(share=engines.load("bullet").LADDER.longest)
    _check(drive=PUBLISHED)
    _check(Contact(0.6, stiffness=1e9, damping=2e6), share=0.0003)
    _check(rock=frustum((1.0, 1.0), (0.6, 0.6), 2.0))


@pytest.mark.parametrize("lifted", range(4))
def test_a_needle_stands_whichever_corner_bullet_cuts_a_digit_off(lifted: int) -> None:
    """Bullet's grid moves a corner by a whole step when its height has one bit more or less."""
    needle = frustum((0.01, 0.01), (0.6, 0.6), 2.0)
    corners = needle.vertices.copy()
    corners[lifted, 2] *= 1.0 - 1e-15
    scene = Scene(replace(needle, vertices=corners), Contact(10.0))
    case = prepare(scene, _limits(needle), reduce=True)
    step = input_checks.longest_step(scene, "bullet")
    input_checks.check_unshaken(case, Settings(step), PULSE)


def test_a_narrow_base_gets_feet_on_level_ground_only(monkeypatch: pytest.MonkeyPatch) -> None:
    needle, given = frustum((0.01, 0.01), (0.6, 0.6), 2.0), []
    feet = collision_shapes._hull_on_feet
    monkeypatch.setattr(
        collision_shapes, "_hull_on_feet", lambda *args: given.append(len(args[1])) or feet(*args)
    )
    ground = slope(0.0, (-2.0, 2.0), 2.0, 1.0, True)
    start = upright((0.0, 0.0, needle.height))
    bullet = engines.load("bullet")
    bullet.build(
        Scene(needle, Contact(0.6), pedestal="terrain", start=start, terrain=ground), 1e-4, 1
    )
    assert given == []
    bullet.build(Scene(needle, Contact(0.6)), 1e-4, 1)
    assert given == [4]


def test_a_rock_that_falls_unshaken_is_refused() -> None:
    slender = box(1.0, 1.0, 100.0)
    case = prepare(Scene(slender, Contact(10.0)), _limits(slender), reduce=True)
    with pytest.raises(InvalidInput, match="where nothing shakes it; it tips at"):
        input_checks.check_unshaken(case, Settings(0.002 * unit(slender)), PULSE)
    leaning_block = Scene(BLOCK, Contact(0.6), start=leaning(BLOCK, 0.6))
    case = prepare(leaning_block, _limits(BLOCK), reduce=True)
    input_checks.check_unshaken(case, Settings(0.002 * unit(BLOCK)), PULSE)  # it is to fall


def test_a_step_too_coarse_for_the_rock_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"rocks too fast for more than 2\.12 ms"):
        _check(share=0.0061)
    slender = box(1.0, 1.0, 20.0)
    _check(rock=slender, share=0.005)
    with pytest.raises(InvalidInput, match="rocks too fast"):
        _check(rock=slender, share=0.005, engine="mujoco")


def test_a_step_too_coarse_for_the_pulse_is_refined() -> None:
    short = CosinePulse.from_g(3.0, 0.005)
    _check(motion=short, share=0.1)
    case = prepare(Scene(BLOCK, Contact(0.6)), _limits(BLOCK), reduce=False)
    steps = simulate(case, short, Settings(0.03, reduce=False)).steps
    assert steps >= 10 * 2.0 * math.pi * 0.99


def test_springs_are_refused_where_they_are_too_soft_or_the_step_too_coarse() -> None:
    with pytest.raises(InvalidInput, match=r"sinks by 41\.4 mm.*1\.69e\+07 N/m"):
        _check(Contact(0.6, stiffness=1e6))
    undamped = Contact(0.6, stiffness=1e8)
    longest = input_checks.longest_step_on_springs(undamped, BLOCK.mass)
    _check(undamped, share=0.99 * longest / unit(BLOCK))
    with pytest.raises(InvalidInput, match=r"at steps up to 0\.062 ms"):
        _check(undamped, share=1.01 * longest / unit(BLOCK))
    for contact in (
        Contact(0.6, 0.5, stiffness=1e9),
        Contact(0.6, stiffness=-1e9),
        Contact(0.6, stiffness=1e9, damping=math.nan),
    ):
        with pytest.raises(InvalidInput):
            _check(contact)


@pytest.mark.parametrize("damping", [0.0, 0.1, 0.9999, 1.0, 1.0001, 5.0])
def test_rebound_of_a_spring_and_a_dashpot(damping: float) -> None:
    """Against the integral of x'' = -2 zeta x' - x until its force is zero."""
    x, v, dt = 0.0, -1.0, 1e-4
    while -2.0 * damping * v - x >= 0.0:
        v += (-2.0 * damping * v - x) * dt
        x += v * dt
    contact = Contact(0.6, stiffness=1e8, damping=damping * math.sqrt(1e8 * BLOCK.mass))
    assert input_checks.rebound(contact, BLOCK.mass) == pytest.approx(v, abs=2e-3)


def test_a_control_period_too_long_for_the_pulse_is_refused() -> None:
    slow = replace(PUBLISHED, kp=5e4, period=0.01)
    _check(drive=slow, motion=CosinePulse.from_g(0.8, 0.026), share=0.002)
    with pytest.raises(InvalidInput, match="control period of 10 ms"):
        _check(drive=slow, motion=CosinePulse.from_g(0.8, 0.024), share=0.002)


@pytest.mark.parametrize("pulse", [CosinePulse(math.nan, 0.3), CosinePulse(9.0, math.inf)])
def test_a_motion_of_no_numbers_is_refused(pulse: CosinePulse) -> None:
    with pytest.raises(InvalidInput, match="not numbers"):
        _check(motion=pulse)


def test_mujoco_is_refused_where_it_topples_what_slides() -> None:
    _check(Contact(0.09), engine="mujoco")
    _check(Contact(0.51), engine="mujoco")
    _check(Contact(0.4))
    with pytest.raises(InvalidInput, match="mujoco lifts what slides"):
        _check(Contact(0.4), engine="mujoco")


# During a run


class Told:
    """A world told where its rock is at each time [s]."""

    def __init__(self, story: Callable[[float], dict[str, object]]) -> None:
        self.story, self.built = story, 0

    def build(self, scene: Scene, time_step: float, substeps: int, solver: object) -> Told:
        self.built += 1
        self.time, self.interval, self.height = 0.0, substeps * time_step, scene.rock.height
        return self

    def advance(self, samples: Iterable[float]) -> None:
        self.time += self.interval * len(list(samples))

    def state(self) -> State:
        rest = State(np.array([0.0, 0.0, self.height]), np.eye(3), np.zeros(3), np.zeros(3))
        return replace(rest, **self.story(self.time))  # type: ignore[arg-type]


def told(
    monkeypatch: pytest.MonkeyPatch,
    story: Callable[[float], dict[str, object]],
    pga_g: float,
    rock: Rock = BLOCK,
) -> tuple[Response, Told]:
    world = Told(story)
    monkeypatch.setattr(engines, "load", lambda name: types.SimpleNamespace(build=world.build))
    case = prepare(Scene(rock, Contact(0.6)), _limits(rock), reduce=False)
    settings = Settings(0.002 * unit(rock), reduce=False)
    return simulate(case, CosinePulse.from_g(pga_g, 0.3), settings), world


def test_a_rock_that_drifts_before_anything_moves_it_is_unstable(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def drifts(time: float) -> dict[str, object]:
        return {"position": np.array([0.06 * time, 0.0, 1.0])}

    weak, world = told(monkeypatch, drifts, 0.4)
    assert weak.outcome is Outcome.UNSTABLE
    assert world.built == HALVINGS + 1
    strong, _ = told(monkeypatch, drifts, 0.8)  # slides, for all we know
    assert strong.outcome is Outcome.DISPLACED


def test_a_rock_that_tips_though_it_can_only_slide_is_unstable(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sin, cos = 0.0447, 0.999
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    for side, outcome in ((6.0, Outcome.UNSTABLE), (1.0, Outcome.BALANCED)):
        place = np.array([0.0, 0.0, cos + 0.5 * side * sin])  # on its edge

        def tips(time: float, place: Array = place) -> dict[str, object]:
            return {"position": place, "rotation": turn} if time > 0.1 else {}

        assert told(monkeypatch, tips, 0.8, box(side, side, 2.0))[0].outcome is outcome


def test_a_rock_that_drifts_after_a_motion_that_moves_nothing_is_unstable(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def drifts(over: float) -> Callable[[float], dict[str, object]]:
        return lambda time: {
            "position": np.array([max(0.0, 0.2 * (time - over)), 0.0, 1.0]),
            "velocity": np.array([0.2, 0.0, 0.0]),
        }

    weak, strong = (CosinePulse.from_g(pga_g, 0.3).duration for pga_g in (0.4, 0.8))
    assert told(monkeypatch, drifts(weak), 0.4)[0].outcome is Outcome.UNSTABLE
    assert told(monkeypatch, drifts(strong), 0.8)[0].outcome is Outcome.DISPLACED


@pytest.mark.parametrize("engine", ["nonsmooth", "bullet", "mujoco"])
def test_every_engine_is_watched_until_something_moves_the_rock(engine: str) -> None:
    """A rock that moves though, by limits that are wrong, nothing can have moved it."""
    case = prepare(Scene(BLOCK, Contact(0.6)), _limits(BLOCK), reduce=False)
    pulse = CosinePulse.from_g(0.7, 0.3)
    settings = Settings(0.02 * unit(BLOCK), reduce=False, engine=engine)
    assert simulate(case, pulse, settings).outcome is not Outcome.UNSTABLE
    wrong = replace(case, static_limits=(-1.001 * pulse.pga, 1.001 * pulse.pga))
    assert simulate(wrong, pulse, settings).outcome is Outcome.UNSTABLE


def test_a_rock_that_creeps_is_not_at_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    def creeps(share: float) -> Callable[[float], dict[str, object]]:
        speed = share * math.sqrt(2e-6 * GRAVITY * BLOCK.radius)
        return lambda time: {
            "position": np.array([speed * time, 0.0, 1.0]),
            "velocity": np.array([speed, 0.0, 0.0]),
        }

    slow, _ = told(monkeypatch, creeps(0.1), 0.8)
    fast, _ = told(monkeypatch, creeps(0.9), 0.8)
    assert slow.outcome is fast.outcome is Outcome.BALANCED
    pulse = CosinePulse.from_g(0.8, 0.3).duration
    assert slow.steps * 0.002 * unit(BLOCK) < pulse + unit(BLOCK)
    assert fast.steps * 0.002 * unit(BLOCK) > pulse + 39.0 * unit(BLOCK)


def test_a_needle_that_hesitates_on_its_edge_is_not_at_rest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its energy is below a millionth of g R, but much of what it has to climb."""
    needle = frustum((0.01, 0.01), (0.6, 0.6), 2.0)
    speed = math.sqrt(0.5e-6 * GRAVITY * needle.radius)
    moving = {"velocity": np.array([speed, 0.0, 0.0])}
    response, _ = told(monkeypatch, lambda time: moving, 0.02, needle)
    assert response.outcome is Outcome.UNSETTLED


def test_no_proof_of_rest_for_a_rock_that_does_not_start_at_rest() -> None:
    start = leaning(BLOCK, 1.05 * math.atan(0.5))
    case = prepare(Scene(BLOCK, Contact(0.6), start=start), _limits(BLOCK), reduce=True)
    response = simulate(case, CosinePulse.from_g(0.01, 0.3), Settings(0.002 * unit(BLOCK)))
    assert response.outcome is Outcome.OVERTURNED


def _module(family: str):  # type: ignore[no-untyped-def]
    import importlib

    return importlib.import_module(f"vsr_core.verification.stability.{family}")
