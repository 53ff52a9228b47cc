"""Work in a process of its own: its result, its errors, and its death come back."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from pipeline.cli import main
from pipeline.config.problems import InputError, Problem
from pipeline.workflow import aside
from pipeline.workflow.batches import Batch
from pipeline.workflow.cluster import Cluster

pytestmark = pytest.mark.skipif(not aside.POSSIBLE, reason="no copies of a process here")


@pytest.fixture
def end() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def test_the_result_comes_from_another_process(end: ExitStack) -> None:
    wait = aside.begin(os.getpid, end)
    assert wait() != os.getpid()


def test_it_goes_on_beside_what_follows(tmp_path: Path, end: ExitStack) -> None:
    first, second = (tmp_path / name for name in ("first", "second"))
    os.mkfifo(first)
    os.mkfifo(second)

    def work() -> str:
        second.write_text("from aside")  # each waits for the other to read
        return first.read_text()

    wait = aside.begin(work, end)
    assert second.read_text() == "from aside"
    first.write_text("from here")
    assert wait() == "from here"


def test_a_refusal_comes_back_whole(end: ExitStack) -> None:
    problem = Problem("site.yaml", "rock.mesh", "nothing", "a rock has a shape", "give one")

    def work() -> None:
        raise InputError(problem)

    with pytest.raises(InputError) as caught:
        aside.begin(work, end)()
    assert caught.value.problems == (problem,)


def test_death_is_an_error(end: ExitStack) -> None:
    with pytest.raises(RuntimeError, match="died"):
        aside.begin(lambda: os._exit(9), end)()


def _process_of_worker(shared: None, items: tuple[int, ...]) -> list[int]:
    return [os.getpid() for _ in items]


def test_it_may_have_workers(end: ExitStack) -> None:
    def work() -> list[int]:
        with Cluster(1, log=lambda line: None) as cluster:
            batches = iter([Batch(None, (1, 2))])
            found = list(cluster.each(_process_of_worker, batches, lambda name: None))
        return [os.getpid(), *(pid for _, _, pid in found)]

    aside_itself, *workers = aside.begin(work, end)()
    assert len(set(workers)) == 1
    assert aside_itself not in {os.getpid(), *workers}


def _until_told_to_end(writing: int) -> Callable[[], None]:
    def work() -> None:
        try:
            os.write(writing, b"begun")
            signal.pause()
        finally:  # where workers are ended
            os.write(writing, b"ended")

    return work


def test_what_nobody_waits_for_is_ended() -> None:
    reading, writing = os.pipe()
    with ExitStack() as end:
        aside.begin(_until_told_to_end(writing), end)
        assert os.read(reading, 5) == b"begun"
    assert os.read(reading, 5) == b"ended"


def test_it_ends_when_the_process_that_waits_is_killed() -> None:
    reading, writing = os.pipe()
    waiting = os.fork()
    if waiting == 0:
        aside.begin(_until_told_to_end(writing), ExitStack())
        signal.pause()
    assert os.read(reading, 5) == b"begun"
    os.kill(waiting, signal.SIGKILL)
    os.waitpid(waiting, 0)
    assert os.read(reading, 5) == b"ended"


SMALL = """\
rock: {shape: box, size: [1.0, 1.0, 2.0], density: 2700}
motion: {pga: {start: 0.2, stop: 1.0, num: 4}, pgv_pga: [0.1, 0.3]}
simulation: {time_step: 0.01}
"""


def test_products_are_the_same_as_in_turn(
    write_site: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site, begun, made = write_site(SMALL), [], []
    begin = aside.begin
    monkeypatch.setattr(aside, "begin", lambda *given: begun.append(given) or begin(*given))
    for possible in (True, False):
        monkeypatch.setattr(aside, "POSSIBLE", possible)
        derived = tmp_path / str(possible)
        assert main(["run", "fragility", "--site", site, "--derived", str(derived)]) == 0
        manifests = (derived / "rock" / ".stages").glob("*.json")
        made.append({path.name: json.loads(path.read_text())["files"] for path in manifests})
    assert len(begun) == 2
    for files in made:
        del files["report.json"]  # which tells how long the runs took
    assert made[0] == made[1]
    assert {"rock.json", "bullet_sample.json", "fragility.json"} <= made[0].keys()
