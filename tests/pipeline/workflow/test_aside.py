"""Work in a process of its own: its result, its errors, and its death come back."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pipeline.config.problems import InputError, Problem
from pipeline.workflow import aside

pytestmark = pytest.mark.skipif(not aside.POSSIBLE, reason="no copies of a process here")


def test_the_result_comes_from_another_process() -> None:
    wait = aside.begin(os.getpid)
    assert wait() != os.getpid()


def test_it_goes_on_beside_what_follows(tmp_path: Path) -> None:
    first, second = (tmp_path / name for name in ("first", "second"))
    os.mkfifo(first)
    os.mkfifo(second)

    def work() -> str:
        second.write_text("from aside")  # each waits for the other to read
        return first.read_text()

    wait = aside.begin(work)
    assert second.read_text() == "from aside"
    first.write_text("from here")
    assert wait() == "from here"


def test_a_refusal_comes_back_whole() -> None:
    problem = Problem("site.yaml", "rock.mesh", "nothing", "a rock has a shape", "give one")

    def work() -> None:
        raise InputError(problem)

    with pytest.raises(InputError) as caught:
        aside.begin(work)()
    assert caught.value.problems == (problem,)


def test_death_is_an_error() -> None:
    with pytest.raises(RuntimeError, match="died"):
        aside.begin(lambda: os._exit(9))()
