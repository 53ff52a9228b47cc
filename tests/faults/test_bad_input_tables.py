"""Tables from outside that are damaged are refused in a line, or say what the whole ones say.

A digit in place of another is no damage that a reader can see; a file that is cut is, and so is a
line that is lost or there twice, but where each line stands for itself.
"""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline import cli
from pipeline.config import outside
from pipeline.config.problems import InputError
from pipeline.stages.hazard.disaggregation import load_disaggregation
from pipeline.stages.hazard.hazard_model import GivenCurve, Realization
from pipeline.stages.studies.validation.recorded_tests import OUTCOMES
from pipeline.stages.studies.validation.recorded_tests import tests_in as read_tests
from tests.support.bad_input import bounded, broken, cut, see_that_it_is_told, taken_or_refused
from tests.support.outside_files import READERS, disaggregation
from tests.support.recorded_tests import recorded_tests
from vsr_core.errors import InvalidInput
from vsr_core.motions.named_columns import of_text
from vsr_core.motions.records.text_files import read_at2


@st.composite
def lines_lost(draw: st.DrawFn, whole: bytes) -> bytes:
    """A file that is cut, or a line of which is lost or there twice."""
    lines = whole.splitlines(keepends=True)
    at = draw(st.integers(0, len(lines) - 1))
    return draw(
        st.sampled_from(
            (b"".join(lines[:at] + lines[at + 1 :]), b"".join([*lines[: at + 1], *lines[at:]]))
        )
        | cut(whole)
    )


@lru_cache(maxsize=1)
def whole(folder: Path, name: str) -> tuple[Path, Path, bytes, Any]:
    """What is read, the file that is damaged, its content, and what the whole one says."""
    reader = READERS[name]
    path = reader.write(folder)
    file = folder / reader.damaged
    return path, file, file.read_bytes(), reader.read(path)


SOME = settings(
    max_examples=500,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
MANY = settings(SOME, max_examples=20_000, derandomize=False, print_blob=True)


def see(folder: Path, name: str, data: Any) -> None:
    path, file, content, said = whole(folder, name)
    seen = READERS[name].seen if data.draw(st.booleans()) else ""
    damage = {"": broken, "lines": lines_lost, "rows": cut, "cut": cut}[seen]
    file.write_bytes(data.draw(damage(content)))
    with bounded(seconds=2.0, mebibytes=200.0):
        found = taken_or_refused(lambda: READERS[name].read(path))
    if found is not None and seen:
        assert found == (said[: len(found)] if seen == "rows" else said)


@pytest.mark.parametrize("name", READERS)
@SOME
@given(data=st.data())
def test_damaged_table_is_refused_or_whole(tmp_path: Path, name: str, data: Any) -> None:
    see(tmp_path, name, data)


@pytest.mark.parametrize("name", READERS)
@settings(SOME, max_examples=3)
@given(data=st.data())
def test_a_command_refuses_a_damaged_table_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, data: Any
) -> None:
    _, file, content, _ = whole(tmp_path, name)
    reader = READERS[name]
    (tmp_path / "site.yaml").write_text(reader.site)
    file.write_bytes(data.draw(broken(content)))
    words = reader.command.format(tmp_path).split()
    capsys.readouterr()
    with bounded(seconds=10.0, mebibytes=500.0):
        code = cli.main([*words, "--derived", str(tmp_path / "derived")])
    see_that_it_is_told(code, capsys.readouterr().err)


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
@MANY
@given(data=st.data())
def test_hunt_of_damaged_tables(tmp_path: Path, name: str, data: Any) -> None:
    see(tmp_path, name, data)


@pytest.mark.parametrize(
    ("name", "row"),
    [
        *((name, b"1\n") for name in ("ages", "faults", "ground motion", "rocks", "nshmp")),
        ("rocks", b'"a,6\n'),
        ("ages", b","),
        ("realizations", b","),
        ("disaggregation", b'"a,6\n'),
    ],
)
def test_a_table_of_megabytes_is_refused_at_once(tmp_path: Path, name: str, row: bytes) -> None:
    """Of many rows, of quotes that do not close, and of one long line."""
    path, file, content, _ = whole(tmp_path, name)
    file.write_bytes(content[: content.index(b"\n") + 1] + row * (40_000_000 // len(row)))
    with bounded(seconds=3.0, mebibytes=200.0), pytest.raises(InputError):
        READERS[name].read(path)


@pytest.mark.parametrize("key", ["mag_bin_edges=[", "weights=[", "imt=", " ", "\n"])
@pytest.mark.parametrize("name", ["disaggregation", "curve"])
def test_a_first_line_is_read_at_once(tmp_path: Path, name: str, key: str) -> None:
    """Each key that has no end is looked for from there on alone."""
    path, file, content, _ = whole(tmp_path, name)
    file.write_bytes(b"#" + key.encode() * (1_000_000 // len(key)) + b"\n" + content)
    with bounded(seconds=2.0, mebibytes=200.0), suppress(InputError):
        READERS[name].read(path)


def test_a_column_of_a_specimen_beyond_counting_is_named(tmp_path: Path) -> None:
    recorded_tests(tmp_path)
    text = (tmp_path / OUTCOMES).read_text()
    (tmp_path / OUTCOMES).write_text(text.replace("dem_s1_soft", f"specimen{'9' * 5000}"))
    assert any("says nothing here" in words for words in read_tests(tmp_path).unused)


def test_bins_without_a_row_are_named(tmp_path: Path) -> None:
    """A file that leaves empty bins out, and one that is cut after a row, are alike."""
    file = disaggregation(tmp_path) / "Mag_Dist-mean-0_1.csv"
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:3]))
    absent, whole = load_disaggregation(tmp_path).unused
    assert absent.startswith("3 bins of PGA not in Mag_Dist")
    assert whole.startswith("bins of 0.5 g have a probability of 0.0005 together, and a poe of")


def test_a_number_with_underscores_is_none_in_any_table(tmp_path: Path) -> None:
    """Python itself would read over them."""
    path, place = tmp_path / "table.csv", {"measure": "PGA", "lon": "1", "lat": "2"}
    given = {"rlz_id": "0", "branch_path": "b_1", "weight": "1"}
    assert outside.rows(path, Realization, [given])[0].branch_path == "b_1"
    for cells in ({**given, "weight": "0_1"}, {**given, "rlz_id": "1_0"}):
        with pytest.raises(InputError, match=r"underscores.* in row 1|in row 1.*underscores"):
            outside.rows(path, Realization, [cells])
    curve = {"levels": ["0.1", "1_0"], "values": ["0.1", "0.01"]}
    with pytest.raises(InputError, match="levels: got '1_0'; a number has no underscores"):
        outside.checked(path, GivenCurve, place | curve, text=True)
    with pytest.raises(InvalidInput, match="values are numbers"):
        of_text("time,x\n0.5,1_0\n0.6,2\n")
    at2 = "PEER\nevent\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 2, DT= .01 SEC\n .1 1_0\n"
    with pytest.raises(InvalidInput, match="a word among its samples"):
        read_at2(at2, None)


def test_a_line_ends_where_editors_end_it(tmp_path: Path) -> None:
    """Not at a form feed or a separator of Unicode, behind which a number sign would be lost."""
    found = outside.table(tmp_path / "table.csv", "name,x\nA\u2028#B\x0c#C,1\r\n# us\r\nD,2\r\n")
    assert found == [{"name": "A\u2028#B\x0c#C", "x": "1"}, {"name": "D", "x": "2"}]
