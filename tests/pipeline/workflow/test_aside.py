"""Work in a process of its own: its result, its errors, and its death come back."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from pipeline.cli import STOPPED, main
from pipeline.config.problems import InputError, Problem, Unfinished
from pipeline.workflow import aside

pytestmark = pytest.mark.skipif(not aside.possible(), reason="no copies of a process here")


def test_the_result_comes_from_another_process() -> None:
    wait = aside.Begun(os.getpid)
    assert wait() != os.getpid()


def test_it_goes_on_beside_what_follows(tmp_path: Path) -> None:
    first, second = (tmp_path / name for name in ("first", "second"))
    os.mkfifo(first)
    os.mkfifo(second)

    def work() -> str:
        second.write_text("from aside")  # each waits for the other to read
        return first.read_text()

    wait = aside.Begun(work)
    assert second.read_text() == "from aside"
    first.write_text("from here")
    assert wait() == "from here"


def test_a_refusal_comes_back_whole() -> None:
    problem = Problem("site.yaml", "rock.mesh", "nothing", "a rock has a shape", "give one")

    def work() -> None:
        raise InputError(problem)

    with pytest.raises(InputError) as caught:
        aside.Begun(work)()
    assert caught.value.problems == (problem,)


def test_death_leaves_work_to_do() -> None:
    with pytest.raises(Unfinished, match="was killed"):
        aside.Begun(lambda: os.kill(os.getpid(), signal.SIGKILL))()


@pytest.mark.slow
def test_it_ends_with_the_process_that_began_it(tmp_path: Path) -> None:
    """As the killer of the kernel ends that one alone."""
    done = tmp_path / "done"

    def work() -> None:
        time.sleep(1.0)
        done.touch()

    if not (child := os.fork()):
        aside.Begun(work)
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    time.sleep(1.5)
    assert not done.exists()


SMALL = """\
rock: {shape: box, size: [1.0, 1.0, 2.0], density: 2700}
motion: {pga: {start: 0.2, stop: 1.0, num: 4}, pgv_pga: [0.1, 0.3]}
simulation: {time_step: 0.01}
"""


def test_it_ends_with_the_call_that_is_interrupted(
    write_site: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by Ctrl-C in a notebook, whose process goes on."""

    class Awaited(aside.Begun[None]):
        def __init__(self, _: object) -> None:
            super().__init__(partial(time.sleep, 60.0))

        def __call__(self) -> None:
            raise KeyboardInterrupt

    monkeypatch.setattr(aside, "Begun", Awaited)
    given = ["--site", write_site(SMALL), "--derived", str(tmp_path / "derived"), "--workers", "0"]
    assert main(["run", "fragility", *given]) == STOPPED
    assert not multiprocessing.active_children()


@pytest.mark.slow
def test_products_are_the_same_as_in_turn(
    write_site: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site, begun, made = write_site(SMALL), [], []
    begin = aside.Begun
    monkeypatch.setattr(aside, "Begun", lambda work: begun.append(work) or begin(work))
    for possible in (True, False):
        monkeypatch.setattr(aside, "possible", partial(bool, possible))
        derived = tmp_path / str(possible)
        assert main(["run", "fragility", "--site", site, "--derived", str(derived)]) == 0
        manifests = (derived / "rock" / ".stages").glob("*.json")
        made.append({path.name: json.loads(path.read_text())["files"] for path in manifests})
    assert len(begun) == 2
    for files in made:
        del files["report.json"]  # which tells how long the runs took
    assert made[0] == made[1]
    assert {"rock.json", "bullet_sample.json", "fragility.json"} <= made[0].keys()
