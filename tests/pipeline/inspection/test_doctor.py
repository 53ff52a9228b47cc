"""`vsr doctor`: a line for each check, and a remedy for each that fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import Ran

from pipeline import cli
from pipeline.config.problems import InputError
from pipeline.inspection import doctor
from pipeline.workflow import cluster
from vsr_core import engines
from vsr_core.compiled import compiling

CHECKS = ["python", "machine code", "threads", "disk", "scheduler", "engines", "self-test"]


def test_a_machine_that_is_well(vsr: Callable[..., Ran], derived: Path) -> None:
    ran = vsr("doctor")
    assert (ran.code, ran.err) == (cli.DONE, "")
    assert [line[:13].strip() for line in ran.out.splitlines()] == CHECKS
    assert not derived.exists()
    quiet = vsr("doctor", "--quiet")
    assert (quiet.code, quiet.out, quiet.err) == (cli.DONE, "", "")


@pytest.mark.slow
def test_what_is_wrong_is_told_with_its_remedy_and_the_rest_goes_on(
    vsr: Callable[..., Ran], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engines, "available", lambda name: name == "nonsmooth")
    monkeypatch.setattr(cluster, "CONNECTING", 0.5)
    ran = vsr("doctor", "--scheduler", "tcp://127.0.0.1:1")
    assert ran.code == cli.REFUSED
    assert len(ran.out.splitlines()) == len(CHECKS)
    scheduler, library = ran.err.splitlines()
    assert "a Dask scheduler answers there" in scheduler
    assert library.endswith("pip install mujoco")
    quiet = vsr("doctor", "--quiet", "--scheduler", "tcp://127.0.0.1:1")
    assert [line.split()[0] for line in quiet.out.splitlines()] == ["scheduler", "engines"]
    assert quiet.err == ran.err


def test_a_full_disk_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    class Full:
        free = doctor.LEAST_ROOM - 1

    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda path: Full)
    with pytest.raises(InputError, match="free space"):
        doctor._disk(tmp_path / "derived")


def test_machine_code_that_is_damaged_or_cannot_be_kept_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    folder = tmp_path / compiling.name()
    monkeypatch.setattr(compiling, "_folders", lambda: (folder,))
    for name in ("one", "two"):
        (folder / "module").mkdir(parents=True, exist_ok=True)
        compiling._seal(folder / "module" / name, b"code")
    assert "2 sealed files" in doctor._machine_code()
    (folder / "module" / "two").write_bytes(b"damaged")
    with pytest.raises(InputError, match=r"1 file in .* damaged"):
        doctor._machine_code()
    monkeypatch.setattr(compiling, "_folders", lambda: (tmp_path,))
    with pytest.raises(InputError, match="none that can be kept"):
        doctor._machine_code()


@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_the_self_test_notices_a_boundary_that_is_off(
    factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = doctor.simulate

    def off(case: Any, pulse: Any, settings: Any) -> Any:
        return right(case, replace(pulse, pga=factor * pulse.pga), settings)

    monkeypatch.setattr(doctor, "simulate", off)
    with pytest.raises(InputError, match="stands, then topples"):
        doctor.self_test()


def test_a_fault_of_the_parser_itself_is_told_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(arguments: object) -> None:
        raise RuntimeError("no parser")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli, "parsed", broken)
    assert cli.main(["list"]) == cli.BROKEN
    (line,) = capsys.readouterr().err.splitlines()
    assert "no parser" in line
    assert "broken" in (tmp_path / "data" / "derived" / "vsr-fault.txt").read_text()
