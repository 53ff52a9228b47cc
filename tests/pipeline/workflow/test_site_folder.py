"""A folder of results holds products of one configuration, and says what other settings left."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml
from conftest import BOX, STEP
from support import record_files

from pipeline import ROOT, cli
from pipeline.config.layers import load_site
from pipeline.workflow.site_folder import stale
from pipeline.workflow.store import Store

SMALL = "motion: {pga: [0.2, 0.6], pgv_pga: [0.2, 0.5]}\n"
OTHER = ("--set", "contact.friction=0.7")

Vsr = Callable[..., Any]


def settings_in(folder: Path) -> dict[str, Any]:
    return dict(yaml.safe_load((folder / "config.yaml").read_text(encoding="utf-8")))


def test_every_setting_is_beside_the_products_after_any_command(
    vsr: Vsr, write_site: Callable[..., str], derived: Path
) -> None:
    site = write_site(SMALL)
    for command in ((), OTHER, ("--set", "hazard.minimum_survival_probability=0.2"), ()):
        assert vsr("run", "rock", "--site", site, *command).code == 0
        settings = load_site(site, None, command[1:]).config.model_dump(mode="json")
        assert settings_in(derived / "rock") == settings


CURVES = ROOT / "data" / "raw" / "hazard" / "made_up"

OWN = {
    "the site": "run rock --site rocks/boulder/boulder.yaml",
    "the site, of a variant": "run rock --site rocks/boulder/boulder.yaml --name rough",
    "the site, planned": "plan rock --site rocks/boulder/boulder.yaml",
    "the site, swept": "run fragility --site rocks/boulder/boulder.yaml --study friction",
    "the site, of a table": "feasible --site rocks/boulder/boulder.yaml",
    "a scan": "run rock --site boulder.yaml --set rock.shape=mesh "
    "--set rock.mesh=rocks/boulder/a.ply",
    "a record": "run fragility --site boulder.yaml --set motion.files=rocks/boulder/motions.csv",
    "a record, swept": "run fragility --site boulder.yaml --study rocks/two.yaml --set "
    "motion.files=rocks/boulder/motions.csv",
    "curves": "run hazard --site boulder.yaml --age 900 --curves rocks/boulder/curves",
    "ages": "run hazard --site boulder.yaml --set hazard.age.kind=samples "
    "--set hazard.age.file=rocks/boulder/hazard.csv",
    "a study": "run rock --site boulder.yaml --study rocks/boulder/config.yaml",
    "a study, compared": f"run hazard --site boulder.yaml --age 900 --curves {CURVES} --set "
    'hazard.compare=[{"name":"a","study":"rocks/boulder/config.yaml"}]',
    "a study, swept": "run fragility --site boulder.yaml --study rocks/boulder/swept.yaml",
    "limits of a table": "feasible --site boulder.yaml --table rocks/boulder/table.yaml",
    "an archive": "archive rocks/archives/archive/archive.csv",
    "a link to the site": "run rock --site rocks/linked/config.yaml",
    "a link to a study": "run rock --site boulder.yaml --study rocks/boulder/linked.yaml",
    "a link to an archive": "archive rocks/archives/list/archive.csv",
}


@pytest.mark.parametrize("case", OWN)
def test_no_result_goes_to_where_ones_own_files_are_read(
    case: str, vsr: Vsr, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder a rock, and rocks given as the folder of results."""
    monkeypatch.chdir(tmp_path)
    record = "kind: record, pga: [0.3], processing: {order: none, highpass: null, lowpass: null}"
    for place in ("rocks/boulder", "."):
        Path(place).mkdir(parents=True, exist_ok=True)
        text = f"{BOX}{STEP}" + f"motion: {{{record}}}\n" * (case.startswith("a record"))
        Path(place, "boulder.yaml").write_text(text)
    Path("rocks/two.yaml").write_text("sweep: {dense: {rock.density: [2000, 3000]}}\n")
    Path("rocks/boulder/swept.yaml").write_text(Path("rocks/two.yaml").read_text())
    Path("rocks/boulder/config.yaml").write_text("contact: {friction: 0.5}\n")
    Path("rocks/boulder/hazard.csv").write_text("age_a\n18000\n21000\n")
    shutil.copy(ROOT / "configs" / "tables" / "mini_shake_robot.yaml", "rocks/boulder/table.yaml")
    trimesh.creation.box().export("rocks/boulder/a.ply")
    wave = 3.0 * np.cos(np.linspace(0.0, 2.0 * np.pi, 401))
    Path("rocks/boulder/motions.csv").write_text(record_files.csv(wave, 0.005))
    shutil.copytree(CURVES, "rocks/boulder/curves")
    Path("rocks/archives/archive").mkdir(parents=True)
    Path("rocks/archives/archive/archive.csv").write_text("name,alpha_1_deg,r_1_m\nA,12,1\n")
    for place, target in (
        ("linked/config.yaml", "linked.yaml"),
        ("boulder/linked.yaml", "two.yaml"),
        ("archives/list/archive.csv", "list.csv"),
    ):
        Path("rocks", place).parent.mkdir(exist_ok=True)
        Path("rocks", place).symlink_to(Path("rocks", target).resolve())
    Path("rocks/linked.yaml").write_text(f"{BOX}{STEP}")
    Path("rocks/list.csv").write_text("name,alpha_1_deg,r_1_m\nA,12,1\n")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    ran = vsr(*OWN[case].split(), into=Path("rocks"))
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1), ran
    assert ", which is read; it holds results and no input; move that, or" in ran.err
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


@pytest.mark.slow
@pytest.mark.parametrize("again", [pytest.param((), marks=pytest.mark.slow), OTHER])
def test_what_other_settings_made_is_marked_until_it_is_made_again(
    vsr: Vsr, write_site: Callable[..., str], derived: Path, again: tuple[str, ...]
) -> None:
    site, page = write_site(SMALL), derived / "rock" / "report.html"
    command = ("--site", site, "--workers", "0")
    assert vsr("run", "fragility", *command).code == 0
    whole = page.read_text(encoding="utf-8")
    assert "Stale" not in whole
    assert vsr("run", "responses", *command, *OTHER).code == 0
    reason = "contact.friction changed: [0.6] is now [0.7]"
    assert (
        f"report is of other settings than config.yaml: {reason}" in vsr("status", *command[:2]).out
    )
    assert reason in page.read_text(encoding="utf-8")
    assert "Stale" in (derived / "index.html").read_text(encoding="utf-8")
    assert "is not what was written" not in vsr("why", *command[:2], *OTHER).out
    assert vsr("run", "fragility", *command, *again).code == 0
    made = page.read_text(encoding="utf-8")
    assert "Stale" not in made
    assert (made == whole) == (not again)
    assert "of other settings" not in vsr("status", *command[:2], *again).out


def test_whoever_is_stopped_before_new_settings_stand_there_leaves_no_product_unmarked(
    vsr: Vsr, write_site: Callable[..., str], derived: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ("run", "motions", "--site", write_site(SMALL), "--workers", "0")
    folder = derived / "rock"
    assert vsr(*command).code == 0
    before = settings_in(folder)

    def stopped(*given: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Store, "publish", stopped)
        assert vsr(*command, "--set", "motion.pga=[0.2]").code == cli.STOPPED
    assert settings_in(folder) == before
    reason = "motion.pga changed: [0.2, 0.6] is now [0.2]"
    assert stale(Store(folder)) == {"motions": reason}
    assert vsr(*command).code == 0  # which has nothing to make
    assert stale(Store(folder)) == {}


@pytest.mark.slow
def test_a_variant_has_products_of_its_own_and_shares_the_runs(
    vsr: Vsr, write_site: Callable[..., str], derived: Path
) -> None:
    site = write_site(SMALL)
    command = ("run", "responses", "--site", site, "--workers", "0")
    assert vsr(*command).code == 0
    before = (derived / "rock" / "responses.nc").read_bytes()
    made = vsr(*command, "--name", "wider", "--set", "yaw=[0, 90]")
    assert "4 runs done" in made.err
    assert (derived / "rock" / "responses.nc").read_bytes() == before
    assert settings_in(derived / "rock@wider")["yaw"] == [0.0, 90.0]
    assert settings_in(derived / "rock")["yaw"] == [0.0]
    assert not (derived / "rock@wider" / "runs.sqlite").exists()
    planned = vsr("plan", "responses", "--site", site, "--set", "yaw=[0, 90]").out
    assert "8 stored, 0 to do" in planned
    assert vsr(*command, "--name", "../elsewhere").code == 2


def test_plan_takes_the_time_of_runs_in_the_same_engine(
    vsr: Vsr, write_site: Callable[..., str]
) -> None:
    command = ("responses", "--site", write_site(SMALL))
    more = ("--set", "yaw=[0, 45, 90]")
    assert "(typical)" in vsr("plan", *command).out
    assert vsr("run", *command, "--workers", "0").code == 0
    assert "(as measured here)" in vsr("plan", *command, *more).out
    other = ("--set", "simulation.engine=bullet")
    assert "(typical)" in vsr("plan", *command, *more, *other).out


@pytest.mark.slow
def test_plan_knows_the_stored_runs_and_the_step_of_a_study_that_was_not_the_last(
    vsr: Vsr, write_site: Callable[..., str]
) -> None:
    site = write_site(SMALL + "simulation: {engine: bullet, time_step: auto}\n")
    command = ("responses", "--site", site)
    assert vsr("run", *command, "--workers", "0").code == 0
    first = vsr("plan", *command).out
    assert "4 stored, 0 to do" in first
    thinner = (*command, "--set", "rock.size=[0.4, 1, 2]")
    assert "4 to do" in vsr("plan", *thinner).out
    assert vsr("run", *thinner, "--workers", "0").code == 0
    again = vsr("plan", *command).out
    assert again.splitlines()[1:3] == first.splitlines()[1:3]


@pytest.mark.slow
def test_what_settings_do_not_make_any_more_is_left_by_a_variant(
    vsr: Vsr, write_site: Callable[..., str], derived: Path, tmp_path: Path
) -> None:
    made = ("run", "rock", "--site", write_site("uncertainty: {members: 0}\n"))
    assert vsr(*made).code == 0
    of_draws = {"config": {"uncertainty.members": 32}, "needs": {}}
    facts = {"key": "k", "facts": of_draws, "unresolved": 0, "retry": 0}
    Store(derived / "rock").publish("uncertainty", facts, {})  # and the site has none any more
    export = ("export", "--to", tmp_path / "study.zip")
    ran = vsr(*export, derived / "rock")
    assert (ran.code, "others with --name in a folder" in ran.err) == (2, True), ran.err
    assert ran.err.startswith(f"vsr: {derived / 'rock'}: uncertainty: got what other settings")
    assert vsr("run", "uncertainty", *made[2:]).code == 2
    assert vsr(*made, "--name", "plain").code == 0
    assert vsr(*export, derived / "rock@plain").code == 0
    assert vsr("check", tmp_path / "study.zip").out.startswith("whole")


def test_results_of_a_site_with_a_sign_of_variants_in_its_name_are_its_own(
    vsr: Vsr, write_site: Callable[..., str], derived: Path
) -> None:
    site = write_site(name="a@b")
    for variant, folder in (((), "a@b"), (("--name", "c"), "a@b@c")):
        ran = vsr("run", "rock", "--site", site, *variant)
        assert (ran.code, "results of another" in ran.err) == (0, False), ran.err
        assert (derived / folder / "rock.nc").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("variant", [(), ("--name", "x")])
def test_two_files_of_one_name_are_two_sites(
    vsr: Vsr,
    write_site: Callable[..., str],
    derived: Path,
    tmp_path: Path,
    variant: tuple[str, ...],
) -> None:
    first = write_site(SMALL)
    (tmp_path / "b").mkdir()
    second = tmp_path / "b" / "rock.yaml"
    second.write_text(Path(first).read_text(encoding="utf-8").replace("[0.5, 1.0", "[0.6, 1.0"))
    assert vsr("run", "rock", "--site", first, *variant).code == 0
    own = derived / "@".join(("rock", *variant[1:]))
    whole = (own / "rock.nc").read_bytes()
    told = vsr("run", "rock", "--site", second, *variant).err
    (other,) = (path.parent for path in derived.glob("rock-*/rock.nc"))
    assert str(other) in told
    assert (own / "rock.nc").read_bytes() == whole
    assert "done" in vsr("status", "rock", "--site", first, *variant).out
    assert "to do" not in vsr("status", "rock", "--site", second, *variant).out
    (tmp_path / "c").mkdir()
    moved = Path(first).rename(tmp_path / "c" / "rock.yaml")  # and its folder with it
    assert f"\nrock in {own}: " in vsr("status", "rock", "--site", moved, *variant).out
    assert f"\nrock in {other}: " in vsr("status", "rock", "--site", second, *variant).out
    assert "to do" not in vsr("status", "rock", "--site", second, *variant).out
