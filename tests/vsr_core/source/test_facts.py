"""Facts about source text that are kept between processes: never those of another text."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from vsr_core.source import tracing

TEXT = b"from vsr_core import G\nLIMIT = 3\ndef used(x):\n    return x * LIMIT * G\n"


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The file of a process that has read nothing yet, and may write."""
    path = tmp_path / "tracing.facts"
    monkeypatch.setattr(tracing, "_FILE", path)
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    next_process()
    yield path
    monkeypatch.undo()
    next_process()


def next_process() -> None:
    tracing._kept.cache_clear()
    tracing._new.clear()


def test_the_next_process_takes_what_was_kept(kept: Path) -> None:
    read = tracing.facts_of("vsr_core.a", TEXT)
    assert read.definitions["used"][1] == ["G", "LIMIT"]
    assert read.imports == [("G", "vsr_core", "G")]
    tracing.keep_facts()
    changed = json.loads(kept.read_text().partition("\n")[2])
    changed["vsr_core.a"][1] = {"seen": ["", []]}
    text = json.dumps(changed)
    kept.write_text(f"{tracing._digest(text.encode())}\n{text}")
    next_process()
    assert set(tracing.facts_of("vsr_core.a", TEXT).definitions) == {"seen"}


def test_another_text_of_the_same_size_and_time_is_read_anew(kept: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.py"
    found = []
    for text in (TEXT, TEXT.replace(b"3", b"4")):
        file.write_bytes(text)
        os.utime(file, (1.0, 1.0))
        found.append(tracing.facts_of("vsr_core.a", file.read_bytes()))
        tracing.keep_facts()
        next_process()
    old, new = (each.definitions for each in found)
    assert {name for name in old if old[name] != new[name]} == {"LIMIT"}


def test_a_changed_reader_reads_anew(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tracing.facts_of("vsr_core.a", TEXT)
    tracing.keep_facts()
    next_process()
    monkeypatch.setattr(tracing, "_reader", lambda: b"another Python")
    tracing.facts_of("vsr_core.a", TEXT)
    assert tracing._new == {"vsr_core.a"}


@pytest.mark.parametrize("damage", ["", "{", "[1]", '{"vsr_core.a": ["", {}, []]}'])
def test_a_damaged_file_is_no_matter(kept: Path, damage: str) -> None:
    kept.write_text(damage)
    assert set(tracing.facts_of("vsr_core.a", TEXT).definitions) == {"LIMIT", "used"}


def test_no_bit_of_what_was_kept_is_believed_otherwise(kept: Path) -> None:
    """A dependency that is lost would leave old results fresh."""
    read = tracing.facts_of("vsr_core.a", TEXT)
    tracing.keep_facts()
    whole = kept.read_bytes()
    for at in range(len(whole)):
        kept.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        next_process()
        assert tracing.facts_of("vsr_core.a", TEXT) == read


def test_nothing_is_written_where_python_writes_no_bytecode(
    kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    tracing.facts_of("vsr_core.a", TEXT)
    tracing.keep_facts()
    assert not kept.exists()
