"""OpenQuake's own file of a calculation, and its disaggregation by magnitude and distance."""

from __future__ import annotations

import json
import math
from pathlib import Path

import h5py
import numpy as np
import pytest

from pipeline.config.problems import InputError
from pipeline.stages.hazard import curve_folder
from pipeline.stages.hazard.shaking_ratio import load_disaggregation
from vsr_core import GRAVITY

LEVELS = {"PGA": [0.01, 0.1, 1.0], "PGV": [0.5, 5.0, 50.0], "SA(1.0)": [0.02, 0.2, 2.0]}
RATES = np.array([[0.2, 4e-3, 2e-5], [0.3, 8e-3, 4e-5]])
WEIGHTS = [0.6, 0.4]
YEARS = 5.0

SHARED = Path(__file__).parents[5] / "shared" / "data" / "hazard" / "disaggregation"


def written(path: Path, older: bool = False, sites: int = 1) -> Path:
    """A file as OpenQuake 3.26 lays it out, or with the parameters as 3.11 wrote them."""
    with h5py.File(path, "w") as file:
        poes = -np.expm1(-YEARS * RATES)
        curves = np.stack([poes, poes / 2.0, poes / 3.0], axis=1)
        file["hcurves-rlzs"] = np.repeat(curves[None], sites, axis=0).astype("f4")
        file["hcurves-rlzs"].attrs["json"] = json.dumps({"imt": list(LEVELS)})
        file["weights"] = np.array(WEIGHTS, dtype="f4")
        for name, value in (("lon", -120.9), ("lat", 35.2)):
            file[f"sitecol/{name}"] = np.full(sites, value)
        text = h5py.string_dtype()
        file["full_lt/sm_data"] = np.array([(b"b1",)], dtype=[("path", text)])
        file["full_lt/gsim_lt"] = np.array([(b"A",), (b"B",)], dtype=[("branch", text)])
        if older:
            table = [("hazard_imtls", repr(LEVELS)), ("investigation_time", repr(YEARS))]
            kinds = [("par_name", text), ("par_value", text)]
            file["oqparam"] = np.array(table, dtype=kinds)
        else:
            settings = {"hazard_imtls": LEVELS, "investigation_time": YEARS}
            file["oqparam"] = json.dumps(settings)
    return path


@pytest.mark.parametrize("older", [False, True])
def test_a_calculation_is_read(tmp_path: Path, older: bool) -> None:
    model = curve_folder.load(written(tmp_path / "calc_7.hdf5", older))
    assert model.location == (-120.9, 35.2)
    assert [(one.name, one.path) for one in model.branches] == [("0", "b1~A"), ("1", "b1~B")]
    assert [one.weight for one in model.branches] == pytest.approx(WEIGHTS)
    for one, rates in zip(model.branches, RATES, strict=True):
        np.testing.assert_allclose(one.pga.levels, GRAVITY * np.array(LEVELS["PGA"]))
        np.testing.assert_allclose(one.pga.rates, rates, rtol=1e-4)  # probabilities in 4 bytes
        assert one.pgv is not None
        np.testing.assert_allclose(one.pgv.levels, [0.005, 0.05, 0.5])


def test_what_is_no_calculation_of_one_site_is_refused(tmp_path: Path) -> None:
    several = written(tmp_path / "several.hdf5", sites=2)
    with pytest.raises(InputError, match="2 sites"):
        curve_folder.load(several)
    certain = written(tmp_path / "certain.hdf5")
    with h5py.File(certain, "r+") as file:
        file["hcurves-rlzs"][0, 0, 0, 0] = 1.0
    with pytest.raises(InputError, match="no finite rate"):
        curve_folder.load(certain)
    other = tmp_path / "other.hdf5"
    other.write_bytes(b"nothing")
    with pytest.raises(InputError, match="individual_rlzs"):
        curve_folder.load(other)
    with h5py.File(other, "w") as file:
        file["oqparam"] = "{}"
    with pytest.raises(InputError, match="individual_rlzs") as error:
        curve_folder.load(other)
    assert str(error.value).count("\n") == 0


def test_a_disaggregation_is_read(tmp_path: Path) -> None:
    path = tmp_path / "Mag_Dist-mean-0_2.csv"
    path.write_text(
        "#,,,,,\"generated_by='OpenQuake engine 3.26.2', investigation_time=1.0\"\n"
        "imt,iml,poe,mag,dist,mean\n"
        "PGA,0.5,1e-3,5.5,10.0,3e-4\nPGA,0.5,1e-3,7.0,10.0,1e-4\n"
        "PGA,0.2,1e-2,5.5,10.0,1e-3\nPGA,0.2,1e-2,7.0,10.0,1e-3\n"
        "PGV,9.0,1e-2,7.0,10.0,1e-3\n",
        encoding="utf-8",
    )
    for given in (path, tmp_path):
        found = load_disaggregation(given)
        np.testing.assert_allclose(found.levels, GRAVITY * np.array([0.2, 0.5]))
        assert found.magnitudes.tolist() == [5.5, 7.0]
        np.testing.assert_allclose(found.shares, [[0.5, 0.5], [0.75, 0.25]])


def test_no_disaggregation_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no disaggregation of PGA"):
        load_disaggregation(tmp_path)
    wrong = tmp_path / "Mag_Dist-mean-0_2.csv"
    wrong.write_text("imt,iml,mag\nPGA,0.5,x\n", encoding="utf-8")
    with pytest.raises(InputError, match="dist: got no such column"):
        load_disaggregation(wrong)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the folder of a disaggregation is not here")
def test_a_disaggregation_that_openquake_wrote() -> None:
    """Its shares at a level add up to the probability that the level is exceeded with."""
    found = load_disaggregation(SHARED)
    assert len(found.levels) == 3
    assert math.isclose(float(found.levels[-1]), 1.09658 * GRAVITY, rel_tol=1e-5)
    np.testing.assert_allclose(found.shares.sum(axis=1), 1.0)
    mean = found.shares @ found.magnitudes
    assert (np.diff(mean) > 0.0).all(), "stronger shaking is of larger earthquakes here"
