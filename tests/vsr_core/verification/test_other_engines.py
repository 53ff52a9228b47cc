"""The other methods: each keeps a block standing, topples it, and is reported when missing."""

from __future__ import annotations

import importlib.util
import math
import types
from pathlib import Path

import numpy as np
import pytest
import trimesh
from support.suites import slow_but

from vsr_core import GRAVITY, engines
from vsr_core.motions.pulses import CosinePulse
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.run import rocking_block
from vsr_core.scene import Contact, Scene
from vsr_core.surrogates.double_rock import double_rock
from vsr_core.verification import other_engines

METHODS = ["dart", "drake", "mujoco_default", "mujoco_stiff", "physx", "published_setup", "rapier"]
PRECISE = [name for name in METHODS if name != "published_setup"]


def installed(name: str) -> other_engines.Method:
    lacking = other_engines.missing(name)
    if lacking:
        pytest.skip(f"the method {name} needs {', '.join(lacking)}, not installed")
    return other_engines.load(name)


def block() -> Rock:
    return solid.box((1.0, 1.0, 2.0), 2110.0).rock


def coarsest(name: str, rock: Rock, friction: float, yaw: float = 0.0) -> other_engines.Test:
    method = installed(name)
    return method.build(Scene(rock, Contact(friction), yaw), method.SWEEP[0])


def test_methods_are_found_without_their_libraries() -> None:
    assert other_engines.names() == METHODS
    methods = [other_engines.load(name) for name in METHODS]
    assert len({method.LABEL for method in methods}) == len(METHODS)
    for method in methods:
        steps = [setting["time_step"] for setting in method.SWEEP]
        assert steps == sorted(steps, reverse=True)


def test_a_method_without_its_library_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    without = types.SimpleNamespace(NEEDS=("math", "no_such_library"))
    monkeypatch.setattr(other_engines, "load", lambda name: without)
    assert other_engines.missing("any") == ("no_such_library",)
    monkeypatch.setattr(importlib.util, "find_spec", lambda need: None)
    assert other_engines.missing("any") == without.NEEDS


@pytest.mark.parametrize("name", METHODS)
def test_a_block_stays_below_uplift_and_topples_under_a_strong_pulse(name: str) -> None:
    """Friction 0.6 as in the paper: enough to rock, and no more than a solver must manage."""
    test = coarsest(name, block(), friction=0.6)
    strong = CosinePulse.from_g(1.2, 0.4)
    tilt = test(strong)
    assert 1.0 < tilt < math.pi
    assert 0.0 <= test(CosinePulse.from_g(0.25, 0.2)) < 0.02
    assert test(strong) == tilt  # whatever ran before


@pytest.mark.parametrize("name", PRECISE)
@pytest.mark.parametrize("friction", [0.6, 10.0])
def test_the_boundary_is_housners(name: str, friction: float) -> None:
    test = coarsest(name, block(), friction)
    ratio = 0.2
    first = rocking_block.first_overturning_pga(
        rocking_block.Block(0.5, 1.0), ratio, 1.0 * GRAVITY, 0.02 * GRAVITY
    )
    assert test(CosinePulse(0.99 * first, ratio)) < 1.0
    assert test(CosinePulse(1.01 * first, ratio)) > 1.0


def surrogate() -> Rock:
    return solid.from_mesh(trimesh.Trimesh(*double_rock(), process=False), 2110.0).rock


@pytest.mark.parametrize("name", slow_but(["published_setup"], METHODS))
def test_the_surrogate_rock_topples_above_its_boundary(name: str) -> None:
    """15 % above 0.19 g, which all methods find to 4 %."""
    test = coarsest(name, surrogate(), friction=0.6)
    assert test(CosinePulse.from_g(0.22, 0.15)) > 1.0


@pytest.mark.parametrize("name", PRECISE)
def test_the_surrogate_rock_rocks_below_its_boundary(name: str) -> None:
    test = coarsest(name, surrogate(), friction=0.6)
    assert 0.02 < test(CosinePulse.from_g(0.16, 0.15)) < 0.2


@pytest.mark.parametrize("name", METHODS)
def test_yaw_turns_the_rock(name: str) -> None:
    """A slab 1 m by 3 m topples along its short side only."""
    slab = solid.box((1.0, 3.0, 2.0), 2110.0).rock
    pulse = CosinePulse.from_g(1.0, 0.4)
    assert coarsest(name, slab, friction=2.0)(pulse) > 1.0
    assert coarsest(name, slab, friction=2.0, yaw=math.pi / 2)(pulse) < 0.02


def test_the_table_gets_its_exact_velocity() -> None:
    pulse = CosinePulse.from_g(0.5, 0.1)
    drive = other_engines.accelerations(pulse, 4e-3)
    assert len(drive) == math.ceil((pulse.duration + other_engines.AFTER) / 4e-3)
    times = 4e-3 * np.arange(1, len(drive) + 1)
    np.testing.assert_allclose(4e-3 * np.cumsum(drive), pulse.velocity(times), atol=1e-12)


def test_a_method_that_diverges_gives_nan() -> None:
    tilts = iter([0.1, math.nan, 0.2])
    drive = np.zeros(3 * other_engines.MONITOR_EVERY)
    assert math.isnan(other_engines.largest_tilt(lambda values: None, lambda: next(tilts), drive))


@pytest.mark.parametrize("name", ["engine", "mujoco_default"])
def test_mujoco_diverges_without_a_word(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Its state tells of it; of itself MuJoCo prints, and writes into the current folder."""
    monkeypatch.chdir(tmp_path)
    if name == "engine":
        world = engines.load("mujoco").build(Scene(block(), Contact(0.6)), 0.002)
        world.advance([0.0] * 5 + [math.nan] * 5)
        assert np.isnan(world.state().position).all()
    else:
        importlib.import_module("mujoco").set_mju_user_warning(None)
        assert math.isnan(coarsest(name, block(), 0.6)(CosinePulse.from_g(1e30, 0.4)))
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())
