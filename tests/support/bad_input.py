"""Strategies of what a user may give by mistake, and what a refusal of it must look like."""

from __future__ import annotations

import gc
import json
import random
import re
import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from hypothesis import strategies as st
from pydantic import BaseModel

from pipeline import cli
from pipeline.config.problems import LONGEST, InputError

Got = TypeVar("Got")

ODD_NUMBERS = (
    *(0, -0.0, -1, 1, 2, 1e308, -1e308, 1e-300, 5e-324, 1e-12, 1e-9, 1e9, 1e-3, 10**30, -(2**63)),
    *(float("nan"), float("inf"), float("-inf"), 0.1 + 0.2, 360.0, 361, 100_000, 100_001),
)
ODD_TEXTS = (
    *("", " ", "a", "none", "true", "1", "1e3", "NaN", "../..", "/", ".", "/dev/null", "a\0b"),
    *("\x1b[2J", "é", "\u202e", "\n", "a: b", "x" * 300, "x" * 5000, "*a", "&a", "{", "%s", "{0}"),
)
ODD = st.one_of(
    st.sampled_from(ODD_NUMBERS),
    st.sampled_from(ODD_TEXTS),
    st.sampled_from((True, False, None, [], {}, [[]], {"start": 0}, [None], [True, 1, 2])),
    st.floats(),
    st.integers(),
    st.text(max_size=8),
).map(lambda value: value)
"""Values that stand in for any other; mapped, so that it counts as one choice among others."""

ONE_LINE = re.compile(r"[^:].*: (got .+; )?.+; .+")
MOST_CHARACTERS = 5 * (LONGEST + 40)


def like(model: type[BaseModel]) -> st.SearchStrategy[dict[str, Any]]:
    """Settings such as a model describes, with something odd in some places.

    Parameters
    ----------
    model : type of a configuration

    Returns
    -------
    strategy of dict
    """
    schema = model.model_json_schema()
    return _like(schema, schema.get("$defs", {}))


def _like(node: dict[str, Any], known: dict[str, Any]) -> st.SearchStrategy[Any]:
    if "$ref" in node:
        return st.deferred(lambda: _like(known[node["$ref"].rpartition("/")[2]], known))
    members = node.get("anyOf") or node.get("oneOf")
    if members:
        return st.one_of([_like(member, known) for member in members])
    if "const" in node or "enum" in node:
        return st.sampled_from(node.get("enum") or [node["const"]]) | ODD
    kind = node.get("type")
    if kind == "object":
        parts = node.get("properties", {})
        needed = {name: _like(parts[name], known) for name in node.get("required", ())}
        others = {name: _like(part, known) for name, part in parts.items() if name not in needed}
        whole = st.fixed_dictionaries(needed, optional=others)
        return st.one_of(whole, whole, whole, ODD)
    if kind == "array":
        items = node.get("prefixItems")
        if items:
            return st.tuples(*[_like(item, known) for item in items]).map(list) | ODD
        return st.lists(_like(node.get("items", {}), known), max_size=4) | ODD
    if kind in ("number", "integer"):
        low = node.get("minimum", node.get("exclusiveMinimum", -1e3))
        high = node.get("maximum", node.get("exclusiveMaximum", 1e3))
        within = st.integers(int(low), int(high)) if kind == "integer" else st.floats(low, high)
        return st.one_of(within, st.sampled_from((low, high)), within, ODD)
    if kind == "boolean":
        return st.booleans() | ODD
    return st.sampled_from(("rock.ply", "records", "m/s2")) | ODD


def taken_or_refused(door: Callable[[], Got]) -> Got | None:
    """What goes through a door, or None where it is refused as everything has to be.

    Parameters
    ----------
    door : callable, which may raise InputError and nothing else

    Returns
    -------
    what the door returns, or None
    """
    try:
        return door()
    except InputError as error:
        refusal = error
    assert refusal.problems
    for problem in refusal.problems:
        see_that_it_is_one_line(str(problem))
    return None


def see_that_it_is_one_line(line: str) -> None:
    """Assert that a problem is told in one line that a terminal can show.

    Parameters
    ----------
    line : str
    """
    assert line.isprintable(), line
    assert ONE_LINE.fullmatch(line), line
    assert len(line) <= MOST_CHARACTERS, len(line)
    assert "Traceback" not in line


def see_that_it_is_told(code: int, said: str) -> None:
    """Assert that a command was done, or has told in lines what is wrong.

    Parameters
    ----------
    code : int, its exit code
    said : str, its standard error
    """
    lines = [line for line in said.splitlines() if line.startswith("vsr: ")]
    lines = [line for line in lines if not line.startswith("vsr: warning: ")]
    assert code in (cli.DONE, cli.UNRESOLVED, cli.REFUSED), said
    assert bool(lines) == (code != cli.DONE), said
    for line in lines:
        see_that_it_is_one_line(line.removeprefix("vsr: "))


def cut(content: bytes) -> st.SearchStrategy[bytes]:
    """The beginning of a file.

    Parameters
    ----------
    content : bytes, of the whole one
    """
    return st.integers(0, len(content) - 1).map(lambda length: content[:length])


BROKEN_WORDS = (
    *(b"nan", b"inf", b"-1", b"0", b"1e308", b"1e-320", b"9" * 30, b"9" * 5000, b"", b" ", b","),
    *(b"\n", b"\0", b"\xff" * 4, b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0" * 4),
)


_SEEDS = st.integers(0, 2**64 - 1)
"""All of a damage is drawn by one of these, as hypothesis takes longer to draw each part of it than
a reader takes to read."""


def broken(whole: bytes) -> st.SearchStrategy[bytes]:
    """A file's content with some of its bytes replaced, put in or left out, or cut short.

    Parameters
    ----------
    whole : bytes
    """

    def damaged(seed: int) -> bytes:
        drawn, content = random.Random(seed), whole
        for _ in range(drawn.randint(1, 4)):
            end = min(len(content), drawn.choice((500, len(content))))  # in a header, or anywhere
            at = drawn.randrange(max(end, 1))
            gone = drawn.choice((0, 1, 4, 12, len(content)))
            other = drawn.randbytes(drawn.randint(0, 6))
            put_in = drawn.choice((drawn.choice(BROKEN_WORDS), other))
            content = content[:at] + put_in + content[at + gone :]
        return content

    return _SEEDS.map(damaged)


@contextmanager
def bounded(seconds: float, mebibytes: float) -> Iterator[None]:
    """Assert how much CPU time is taken, and by how much the most memory of this process grows.

    That of other threads does not count, nor what it takes to look for garbage among what other
    tests have left.

    Parameters
    ----------
    seconds, mebibytes : float
    """
    cleaning: list[float] = []

    def clean(phase: str, info: dict[str, int]) -> None:
        cleaning.append(time.thread_time() * (1.0 if phase == "stop" else -1.0))

    gc.callbacks.append(clean)
    start, before = time.thread_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        yield
        used = time.thread_time() - start - sum(cleaning)
    finally:
        gc.callbacks.remove(clean)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert used < seconds, f"{used:.1f} s"
    assert grown < mebibytes, f"{grown:.0f} MiB"


def settings_of(model: type[BaseModel]) -> st.SearchStrategy[tuple[str, ...]]:
    """A few settings, ``key=value``, of keys of a model, with values near and beyond its limits.

    Parameters
    ----------
    model : type of a configuration

    Returns
    -------
    strategy of tuple of str
    """
    schema = model.model_json_schema()
    leaves = dict(_leaves(schema, schema.get("$defs", {}), ""))
    one = st.sampled_from(sorted(leaves)).flatmap(
        lambda key: leaves[key].map(lambda value: f"{key}={json.dumps(value)}")
    )
    return st.lists(one, min_size=1, max_size=3).map(tuple)


def _leaves(
    node: dict[str, Any], known: dict[str, Any], above: str
) -> Iterator[tuple[str, st.SearchStrategy[Any]]]:
    if "$ref" in node:
        yield from _leaves(known[node["$ref"].rpartition("/")[2]], known, above)
        return
    if above:
        yield above, _like(node, known)
    for member in (*node.get("anyOf", ()), *node.get("oneOf", ())):
        yield from _leaves(member, known, above)
    for name, part in node.get("properties", {}).items():
        yield from _leaves(part, known, f"{above}.{name}" if above else name)
