"""What is typed wrongly at make is refused in a line that names what to change, exit code 2."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

from pipeline import ROOT

REFUSED = {
    "plan SITE=double_rock YAWS=0,90": ("no variable YAWS", "did you mean YAW?"),
    "plan site=double_rock": ("no variable site", "did you mean SITE?"),
    "plan SITE=double_rock PGA=0.4": ("no variable PGA", "it takes DERIVED FRICTION NAME SET SITE"),
    "figures SITE=double_rock": ("no variable SITE", "FIG"),
    "replay SITE=double_rock PGVPGA=0.4": ("no variable PGVPGA", "did you mean PGV_PGA?"),
    "lint SITE=double_rock": ("no variable SITE", "it takes none"),
    "frgility SITE=double_rock": ("no target `frgility`", "`make` alone lists"),
    "tests": ("no target `tests`",),
    "fragility": ("--site: no site given", "with make SITE="),
    "clean YES=1 SITE=": ("--site: got ''", "omit it"),
    "clean YES=0": ("YES: got 0", "leave it out or give YES=1"),
    "clean YES='1 1'": ("YES: got 1 1", "leave it out or give YES=1"),
    "-n lock UPGRADE=no": ("UPGRADE: got no", "leave it out or give UPGRADE=1"),
}


READY = ("-o", "setup", "-o", "setup-dev", "-o", "setup-lint")
"""What runs the tests is installed, whatever has been edited since."""


def make(
    *words: str, folder: Path = ROOT, user: tuple[str, ...] = ()
) -> subprocess.CompletedProcess[str]:
    command = [*user, "make", *words]
    own = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    return subprocess.run(
        command, capture_output=True, text=True, cwd=folder, check=False, timeout=60, env=own
    )


def see_that_it_is_refused(done: subprocess.CompletedProcess[str], words: tuple[str, ...]) -> None:
    assert done.returncode == 2
    first, *rest = done.stderr.splitlines()
    assert [word for word in words if word not in first] == []
    assert all(one.startswith("make: *** [Makefile") for one in rest)  # make's own word of it
    assert done.stdout == ""


@pytest.mark.parametrize("line", REFUSED)
def test_make_refuses_in_a_line(tmp_path: Path, line: str) -> None:
    own = [f"DERIVED={tmp_path}"] if line.startswith(("clean", "fragility")) else []
    see_that_it_is_refused(make(*READY, *shlex.split(line), *own), REFUSED[line])


@pytest.mark.slow
def test_settings_are_parted_where_a_key_begins(tmp_path: Path) -> None:
    given = "motion.pga={start: 0.1, stop: 1, num: 5} yaw=[0, 90] motion.pgv_pga=0.3"
    done = make(*READY, "plan", "SITE=cuboid_1x1x2", f"SET={given}", f"DERIVED={tmp_path}")
    assert "runs: 10; 0 stored" in done.stdout, done.stderr


def test_several_targets_share_their_variables() -> None:
    done = make(*READY, "-n", "replay", "plan", "SITE=double_rock", "PGA=0.4")
    assert done.returncode == 0, done.stderr


def test_what_others_set_in_the_environment_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    command = (*READY, "-n", "stability", "clean", "SITE=rock")
    plain = make(*command).stdout
    for name, value in {"NAME": "desktop", "YES": "1"}.items():
        monkeypatch.setenv(name, value)
    assert make(*command).stdout == plain


def test_a_site_given_before_make_is_all_that_is_removed(monkeypatch: pytest.MonkeyPatch) -> None:
    after = make(*READY, "-n", "clean", "SITE=rock", "DERIVED=there", "YES=1").stdout
    assert "--site 'rock' --derived 'there' --yes" in " ".join(after.split())
    monkeypatch.setenv("SITE", "rock")
    monkeypatch.setenv("DERIVED", "there")
    assert make(*READY, "-n", "clean", "YES=1").stdout == after


SETPRIV = shutil.which("setpriv")
NOBODY = (SETPRIV, "--reuid=65534", "--regid=65534", "--clear-groups") if SETPRIV else ()
ROOTS = os.geteuid() == 0


@pytest.mark.skipif(ROOTS and not NOBODY, reason="root may write everywhere")
def test_checkout_that_cannot_be_written() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file in ("Makefile", "scripts/setup.sh", "requirements.lock"):
            (folder / file).parent.mkdir(exist_ok=True)
            shutil.copy(ROOT / file, folder / file)
        (folder / ".venv").mkdir()
        (folder / ".venv" / ".environment").touch()
        folder.chmod(0o555)
        (folder / ".venv").chmod(0o555)
        done = make("fragility", folder=folder, user=NOBODY if ROOTS else ())
        folder.chmod(0o755)
        (folder / ".venv").chmod(0o755)
    see_that_it_is_refused(done, (f"setup: {folder} cannot be written to", "copy it"))
