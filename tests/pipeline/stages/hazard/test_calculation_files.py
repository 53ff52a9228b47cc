"""OpenQuake's own file of a calculation, and its disaggregation by magnitude and distance."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from pipeline import ROOT
from pipeline.config.layers import load_site
from pipeline.config.problems import InputError
from pipeline.stages.hazard import curve_folder, event_files, hdf5_files
from pipeline.stages.hazard.disaggregation import load_disaggregation
from tests.support.bad_input import bounded
from tests.support.event_sets import EventSet
from tests.support.outside_files import nshmp, of_events
from vsr_core import GRAVITY

LEVELS = {"PGA": [0.01, 0.1, 1.0], "PGV": [0.5, 5.0, 50.0], "SA(1.0)": [0.02, 0.2, 2.0]}
RATES = np.array([[0.2, 4e-3, 2e-5], [0.3, 8e-3, 4e-5]])
WEIGHTS = [0.6, 0.4]
YEARS = 5.0

MADE_UP = ROOT / "data" / "raw" / "hazard" / "made_up"
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


def test_a_key_that_stands_twice_among_the_parameters_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        settings = json.dumps({"hazard_imtls": LEVELS, "investigation_time": YEARS})
        put(file, "oqparam", f'{settings[:-1]}, "investigation_time": 1.0}}')
    with pytest.raises(InputError, match="a key that stands there twice"):
        curve_folder.load(path)


def of_older(change: Callable[[list[tuple[str, str]]], None]) -> Callable[[h5py.File], None]:
    """Parameters as a table, changed."""

    def put_changed(file: h5py.File) -> None:
        table = [("hazard_imtls", repr(LEVELS)), ("investigation_time", repr(YEARS))]
        change(table)
        text = h5py.string_dtype()
        put(file, "oqparam", np.array(table, dtype=[("par_name", text), ("par_value", text)]))

    return put_changed


@pytest.mark.parametrize(
    "change",
    [
        of_older(lambda table: table.append(("investigation_time", "1.0"))),
        of_older(lambda table: table.append(table[0])),
        of_older(
            lambda table: table.insert(0, (table[0][0], f"{table.pop(0)[1][:-1]}, 'PGA': []}}"))
        ),
        lambda file: named(
            file, '{"imt": ["PGA", "SA(1.0)", "PGV"], "imt": ["PGV", "SA(1.0)", "PGA"]}'
        ),
    ],
)
def test_what_stands_twice_in_a_calculation_is_refused(
    tmp_path: Path, change: Callable[[h5py.File], None]
) -> None:
    path = written(tmp_path / "calc_7.hdf5", older=True)
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(InputError, match="a key that stands there twice"):
        curve_folder.load(path)


@pytest.mark.parametrize("changed", [False, True])
def test_realizations_that_contradict_the_mean_of_the_file_are_told(
    tmp_path: Path, changed: bool
) -> None:
    path = written(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        curves = file["hcurves-rlzs"][()]
        mean = np.tensordot(WEIGHTS, curves[0], axes=1)
        file["hcurves-stats"] = np.stack([curves[0, 1], mean])[None].astype("f4")
        said = {"imt": list(LEVELS), "stat": ["quantile-0.95", "mean"]}
        file["hcurves-stats"].attrs["json"] = json.dumps(said)
        if changed:
            file["weights"][...] = WEIGHTS[::-1]
    told = curve_folder.load(path).unused
    assert len(told) == 2 * changed
    assert all("% off the mean of the realizations" in line for line in told)
    with h5py.File(path, "r+") as file:
        del file["hcurves-stats"]
        file["hcurves-stats"] = curves[:, :, :2]
        file["hcurves-stats"].attrs["json"] = json.dumps(said)
    with pytest.raises(InputError, match="hcurves-stats with 2 of imt, which says"):
        curve_folder.load(path)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"rlz_id": 3}, "with 2 of rlz_id, which says 3"),
        ({"lvl": 25}, "with 3 of lvl, which says 25"),
        ({"site_id": 3}, "with 1 of site_id, which says 3"),
        ({"shape_descr": ["site_id", "rlz_id", "lvl", "imt"]}, "hcurves-rlzs by "),
    ],
)
def test_curves_that_are_not_as_many_as_they_say_are_refused(
    tmp_path: Path, said: dict[str, Any], words: str
) -> None:
    path = written(tmp_path / "calc_7.hdf5")
    whole = {"site_id": 1, "rlz_id": 2, "imt": list(LEVELS), "lvl": 3}
    for told in (whole | {"shape_descr": [*whole]}, whole | said):
        model = curve_folder.load(path)
        assert [one.weight for one in model.branches] == pytest.approx(WEIGHTS)
        with h5py.File(path, "r+") as file:
            file["hcurves-rlzs"].attrs["json"] = json.dumps(told)
    with pytest.raises(InputError, match=words):
        curve_folder.load(path)


def test_weights_that_the_logic_tree_does_not_make_are_refused(tmp_path: Path) -> None:
    """Of two source models and one ground-motion model; sampled ones have weights of their own."""
    path = written(tmp_path / "calc_7.hdf5")
    kinds = [("path", "S9"), ("branch", "S9"), ("weight", "f4")]
    with h5py.File(path, "r+") as file:
        models = [(b"b1", b"", WEIGHTS[0]), (b"b2", b"", WEIGHTS[1])]
        for name, rows in (("sm_data", models), ("gsim_lt", [(b"", b"A", 1.0)])):
            put(file, f"full_lt/{name}", np.array(rows, dtype=kinds))
    assert [one.path for one in curve_folder.load(path).branches] == ["b1~A", "b2~A"]
    with h5py.File(path, "r+") as file:
        file["weights"][...] = WEIGHTS[::-1]
    with pytest.raises(InputError, match=r"the logic tree does not make, as 0.4 for 0.6"):
        curve_folder.load(path)
    settings = {"hazard_imtls": LEVELS, "investigation_time": YEARS}
    with h5py.File(path, "r+") as file:
        put(file, "oqparam", json.dumps(settings | {"number_of_logic_tree_samples": 2}))
    assert curve_folder.load(path).branches[0].path == "realization 0"


@pytest.mark.parametrize("sampled", [False, True])
def test_realizations_of_several_regions_or_of_samples_have_numbers(
    tmp_path: Path, sampled: bool
) -> None:
    """Two models of motion in each of two regions are four rows, and four pairs of other models."""
    path = written(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        if sampled:
            settings = {"hazard_imtls": LEVELS, "investigation_time": YEARS}
            put(file, "oqparam", json.dumps(settings | {"number_of_logic_tree_samples": 2}))
        else:
            kinds = [("trt", "S9"), ("branch", "S9")]
            two = np.array([(b"active", b"A"), (b"stable", b"B")], dtype=kinds)
            put(file, "full_lt/gsim_lt", two)
    found = [one.path for one in curve_folder.load(path).branches]
    assert found == ["realization 0", "realization 1"]


def test_weights_of_pga_of_their_own_are_refused(tmp_path: Path) -> None:
    """As of a logic tree whose models of motion have other weights for each measure."""
    path = written(tmp_path / "calc_7.hdf5")
    kinds = [("branch", "S9"), ("PGA", "f8"), ("weight", "f8")]
    with h5py.File(path, "r+") as file:
        put(file, "full_lt/gsim_lt", np.array([(b"A", 0.1, 0.4), (b"B", 0.9, 0.6)], dtype=kinds))
    with pytest.raises(InputError, match="weights of PGA of their own, which are not read"):
        curve_folder.load(path)


def test_a_damaged_heap_of_packed_arrays_is_refused(tmp_path: Path) -> None:
    """What refers to it is packed as well, so that nothing in the file seems to."""
    path = tmp_path / "calc_7.hdf5"
    with h5py.File(path, "w") as file:
        of_surfaces = file.create_dataset(
            "surfaces", (2,), h5py.vlen_dtype("f4"), chunks=(2,), compression="gzip"
        )
        of_surfaces[:] = [np.ones(3), np.ones(5)]
        assert [len(one) for one in hdf5_files.content(of_surfaces, 2)] == [3, 5]
    stored = bytearray(path.read_bytes())
    heap = stored.index(b"GCOL")
    stored[heap + 16 + 8 : heap + 16 + 16] = ((1 << 64) - 16).to_bytes(8, "little")
    path.write_bytes(stored)
    with h5py.File(path) as file, pytest.raises(ValueError, match=f"damaged heap at byte {heap}"):
        hdf5_files.content(file["surfaces"], 2)


@pytest.mark.parametrize(("place", "taken"), [("239.1, 35.2", True), ("10.5, 45.2", False)])
def test_a_disaggregation_of_another_place_than_the_curves(
    tmp_path: Path, place: str, taken: bool
) -> None:
    lon, lat = place.split(", ")
    file = disaggregated(tmp_path, {"mean": MEAN}, f"{EDGES}, lon={lon}, lat={lat}")
    path = written(tmp_path / "calc_7.hdf5")
    given = (
        f"hazard.curves={path}",
        f"hazard.disaggregation={file}",
        "hazard.age={kind: normal, mean: 5000}",
    )
    site = load_site("double_rock", None, given)
    if taken:
        assert curve_folder.find(site.config.hazard, site).disaggregated == file
    else:
        with pytest.raises(InputError, match=r"lon, lat: got 10.5, 45.2, and curves of -120.9"):
            curve_folder.find(site.config.hazard, site)


def test_what_is_no_calculation_of_one_site_is_refused(tmp_path: Path) -> None:
    several = written(tmp_path / "several.hdf5", sites=2)
    with pytest.raises(InputError, match="2 sites"):
        curve_folder.load(several)
    certain = written(tmp_path / "certain.hdf5")
    with h5py.File(certain, "r+") as file:
        file["hcurves-rlzs"][0, 0, 0, 0] = 1.0
    whole, cut = (curve_folder.load(path) for path in (written(tmp_path / "whole.hdf5"), certain))
    (said,) = cut.unused
    left_out = "left out at the beginning of all curves, as in some the probability is 1"
    assert said == f"1 level of PGA {left_out}"
    for one, other in zip(whole.branches, cut.branches, strict=True):  # or the mean lacks a rate
        assert other.pga.levels.tolist() == one.pga.levels[1:].tolist()
        assert other.pga.rates.tolist() == one.pga.rates[1:].tolist()
    with h5py.File(certain, "r+") as file:
        file["hcurves-rlzs"][0, 0, 0, 1] = 1.0
        file["hcurves-rlzs"][0, 0, 0, 0] = 0.5
    with pytest.raises(InputError, match="a probability that rises to 1"):
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


def test_realizations_are_as_many_as_a_hazard_takes_minutes_for(tmp_path: Path) -> None:
    path, number = written(tmp_path / "calc_7.hdf5"), 20_001
    with h5py.File(path, "r+") as file:
        put(file, CURVES, np.repeat(file[CURVES][:, :1], number, axis=1))
        put(file, "weights", np.full(number, 1.0 / number))
    with pytest.raises(InputError, match="got 20,001 realizations; there are at most 20,000"):
        curve_folder.load(path)


CURVES = "hcurves-rlzs"
DAMAGES: dict[str, tuple[Callable[[h5py.File], Any], str]] = {
    "one number": (lambda file: put(file, CURVES, 0.5), "individual_rlzs"),
    "short curves": (lambda file: put(file, CURVES, file[CURVES][..., :2]), "2 values; there is"),
    "none": (lambda file: put(file, CURVES, np.full((1, 2, 3, 3), np.nan)), "got nan"),
    "below 0": (lambda file: put(file, CURVES, -file[CURVES][...]), "values.0: got -0.6"),
    "four terabytes": (lambda file: bomb(file), "values of hcurves"),
    "weights of another file": (lambda file: elsewhere(file), "weights: got a part that is kept"),
    "weights in raw bytes": (lambda file: outside(file), "weights: got a part that is kept"),
    "raw bytes under a name in no UTF-8": (
        lambda file: file.create_dataset(b"\xfc", (2,), "f8", external=[("a", 0, 16)]),
        r"\\xfc: got a part that is kept",
    ),
    "a link to a pipe": (lambda file: linked(file), "weights: got a part that is kept"),
    "more levels than read": (lambda file: full(file, 10_000, 501), "5,010,000 values of PGA"),
    "no weights": (lambda file: put(file, "weights", np.zeros(0)), "individual_rlzs"),
    "negative weights": (lambda file: put(file, "weights", [-0.5, 1.5]), "weight: got -0.5"),
    "weights in words": (lambda file: put(file, "weights", [b"a", b"b"]), "individual_rlzs"),
    "a measure twice": (lambda file: named(file, '{"imt": ["PGA", "PGA", "PGV"]}'), "3 curves of"),
    "measures with numbers": (
        lambda file: named(file, json.dumps({"imt": dict.fromkeys(LEVELS, 0)})),
        "3 curves of {",
    ),
    "a number for measures": (lambda file: named(file, '{"imt": 5}'), "individual_rlzs"),
    "nothing for a measure": (lambda file: named(file, '{"imt": [null]}'), "individual_rlzs"),
    "deep": (lambda file: put(file, "oqparam", "[" * 60_000), "individual_rlzs"),
    "levels in words": (lambda file: parameters(file, {"PGA": "x"}), "individual_rlzs"),
    "levels of nothing": (lambda file: parameters(file, {}), "individual_rlzs"),
    "no place": (lambda file: put(file, "sitecol/lon", [math.nan]), "lon: got nan"),
    "no longitude": (lambda file: put(file, "sitecol/lon", np.zeros(0)), "sitecol: got 0 sites"),
    "two latitudes": (lambda file: put(file, "sitecol/lat", [35.2, 36.2]), "sitecol: got 2 sites"),
    "one measure twice": (lambda file: twice(file), "with 1 of imt, which says"),
    "more weights": (
        lambda file: put(file, "weights", [0.2, 0.4, 0.3, 0.1]),
        "4 weights of 2 realizations",
    ),
    "imaginary": (lambda file: put(file, CURVES, file[CURVES][...] * 1j), "complex64 for numbers"),
    "a switch for years": (lambda file: parameters(file, LEVELS, True), "True for a number"),
    "underscores": (
        lambda file: parameters(file, LEVELS | {"PGA": ["0.01", "0.1", "1_0"]}),
        "'1_0' for a number",
    ),
}


def put(file: h5py.File, name: str, values: Any) -> None:
    facts = dict(file[name].attrs)
    del file[name]
    file[name] = values
    file[name].attrs.update(facts)


def named(file: h5py.File, measures: str) -> None:
    file[CURVES].attrs["json"] = measures


def twice(file: h5py.File) -> None:
    put(file, CURVES, file[CURVES][:, :, :1])
    named(file, '{"imt": ["PGA", "PGA"]}')


def parameters(file: h5py.File, levels: dict[str, Any], years: float = YEARS) -> None:
    put(file, "oqparam", json.dumps({"hazard_imtls": levels, "investigation_time": years}))


def elsewhere(file: h5py.File) -> None:
    """Weights of a file that is missing, which HDF5 takes for halves."""
    del file["weights"]
    layout = h5py.VirtualLayout((2,), "f8")
    layout[:] = h5py.VirtualSource("missing.hdf5", "weights", shape=(2,))
    file.create_virtual_dataset("weights", layout, fillvalue=0.5)


def outside(file: h5py.File) -> None:
    del file["weights"]
    raw = Path(file.filename).with_name("weights.raw")
    raw.write_bytes(np.full(2, 0.5).tobytes())
    file.create_dataset("weights", (2,), "f8", external=[(str(raw), 0, 16)])


def test_what_is_kept_elsewhere_is_not_read_whatever_else_is_damaged(tmp_path: Path) -> None:
    """Nothing of such a file is listed, so that no part of it is refused before."""
    with h5py.File(written(tmp_path / "calc_7.hdf5"), "r+") as file:
        outside(file)
        with pytest.raises(ValueError, match="weights that stands in other files"):
            hdf5_files.content(file["weights"], 10)


def linked(file: h5py.File) -> None:
    """To a pipe, at which HDF5 would wait for ever."""
    del file["weights"]
    pipe = Path(file.filename).with_name("other.hdf5")
    os.mkfifo(pipe)
    file["weights"] = h5py.ExternalLink(pipe, "weights")


def bomb(file: h5py.File) -> None:
    """Numbers that are not stored, as they are all alike."""
    del file[CURVES]
    shape = (1, 10**6, 1, 10**6)
    file.create_dataset(CURVES, shape, "f4", chunks=(1, 1000, 1, 1000), compression="gzip")
    named(file, '{"imt": ["PGA"]}')


def full(file: h5py.File, realizations: int, levels: int) -> None:
    """Curves that nothing exceeds, which take few bytes of a file."""
    del file[CURVES]
    shape = (1, realizations, 1, levels)
    file.create_dataset(CURVES, data=np.zeros(shape, "f4"), compression="gzip")
    named(file, '{"imt": ["PGA"]}')
    put(file, "weights", np.full(realizations, 1.0 / realizations))
    parameters(file, {"PGA": np.geomspace(5e-3, 3.0, levels).tolist()})


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_calculation_is_refused(tmp_path: Path, damage: str) -> None:
    change, words = DAMAGES[damage]
    path = written(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        change(file)
    with bounded(seconds=1.0, mebibytes=100.0), pytest.raises(InputError, match=words) as error:
        curve_folder.load(path)
    assert str(error.value).count("\n") == 0


OF_EVENTS = EventSet(400.0, ruptures=40).write_calculation


@pytest.mark.parametrize(
    ("write", "load", "name", "place"),
    [
        (written, curve_folder.load, "oqparam", 0),
        (OF_EVENTS, lambda path: event_files.load(path, None), "oqparam", 0),
        (OF_EVENTS, of_events, "rupgeoms", 16),
        (OF_EVENTS, of_events, "full_lt/sm_data", 20),
        (OF_EVENTS, of_events, "full_lt/sm_data", 40),
    ],
)
def test_no_room_is_made_for_what_is_longer_than_its_file(
    tmp_path: Path,
    write: Callable[[Path], Path],
    load: Callable[[Path], Any],
    name: str,
    place: int,
) -> None:
    path = write(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        if name.endswith("sm_data"):  # as the latest versions write them
            text = h5py.string_dtype()
            members = [("name", text), ("weight", "<f4"), ("path", text), ("samples", "<u4")]
            put(file, name, np.array([("one", 0.3, "b", 1), ("two", 0.7, "c", 1)], members))
            del file["full_lt/gsim_lt"]  # of two models of sources, each with all of these
            branches = np.array([(b"d", b"only"), (b"e", b"only")], [("branch", "S9"), ("x", "S9")])
            file["full_lt/gsim_lt"] = branches[:1]
        stored = file[name].id
        chunk = stored.get_chunk_info(0) if file[name].chunks else None
        offset = chunk.byte_offset if chunk else stored.get_offset()
    load(path)
    content = bytearray(path.read_bytes())
    content[offset + place : offset + place + 4] = (593_000_000).to_bytes(4, "little")
    path.write_bytes(content)
    with (
        bounded(seconds=2.0, mebibytes=100.0),
        pytest.raises(InputError, match=r"593,0.* bytes of"),
    ):
        load(path)


@pytest.mark.parametrize("layout", ["earliest", "latest"])
def test_nor_for_an_attribute(tmp_path: Path, layout: str) -> None:
    path, length = tmp_path / "calc_7.hdf5", len(json.dumps({"imt": list(LEVELS)}))
    with (
        h5py.File(written(tmp_path / "made.hdf5")) as made,
        h5py.File(path, "w", libver=layout) as file,
    ):
        for name in made:
            made.copy(name, file)
    curve_folder.load(path)
    content = path.read_bytes()
    at = content.index(length.to_bytes(4, "little"), content.index(b"json\0"))
    path.write_bytes(content[:at] + (593_000_000).to_bytes(4, "little") + content[at + 4 :])
    with (
        bounded(seconds=2.0, mebibytes=100.0),
        pytest.raises(InputError, match=r"593,000,000 bytes of json"),
    ):
        curve_folder.load(path)


def test_a_disaggregation_is_read(tmp_path: Path) -> None:
    path = tmp_path / "Mag_Dist-mean-0_2.csv"
    path.write_text(
        "#,,,,,\"generated_by='OpenQuake engine 3.26.2', investigation_time=1.0\"\n"
        "imt,iml,poe,mag,dist,mean\n"
        "PGA,0.5,4e-4,5.5,10.0,3.00000E-04\nPGA,0.5,4e-4,7.0,10.0,1.00000E-04\n"
        "PGA,0.2,nan,5.5,10.0,1.00000E-03\nPGA,0.2,nan,7.0,10.0,1.00000E-03\n"
        "PGV,9.0,1e-2,7.0,10.0,1e-3\n",
        encoding="utf-8",
    )
    for given in (path, tmp_path):
        found = load_disaggregation(given)
        np.testing.assert_allclose(found.levels, GRAVITY * np.array([0.2, 0.5]))
        assert found.magnitudes.tolist() == [5.5, 7.0]
        np.testing.assert_allclose(found.shares, [[0.5, 0.5], by_rates([3e-4, 1e-4])])
        assert found.unused == (f"1 row of other measures in {path.name} left out",)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("PGA,0.5,1e-3,nan,10,0.3", "mag: got 'nan' in row 3"),
        ("PGA,0.5,1e-3,inf,10,0.3", "mag: got 'inf'"),
        ("PGA,0,1e-3,6.5,10,0.3", "iml: got '0'"),
        ("PGA,-0.1,1e-3,6.5,10,0.3", "iml: got '-0.1'"),
        ("PGA,490,1e-3,6.5,10,0.3", "iml: got '490'"),
        ("PGA,0.5,1e-3,6.5,-10,0.3", "dist: got '-10'"),
        ("PGA,0.5,1e-3,6.5,10,7", "shares.0: got '7'"),
        ("PGA,0.5,1e-3,6.5,10,-0.3", "shares.0: got '-0.3'"),
        ("PGA,0.5,1e-3,6.5,10,inf", "shares.0: got 'inf'"),
        ("PGA,0.5,1e-3,5.5,10,0.3", "twice"),
        ("PGA,0.5,1e-3,5.5", "4 fields in row 3"),
    ],
)
def test_a_bin_that_is_none_is_refused(tmp_path: Path, row: str, words: str) -> None:
    path = tmp_path / "Mag_Dist-mean-0_2.csv"
    rows = ["imt,iml,poe,mag,dist,mean", "PGA,0.5,1e-3,5.5,10,0.3", "PGA,0.2,1e-2,5.5,10,0.2"]
    path.write_text("\n".join([*rows, row, ""]), encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(words)):
        load_disaggregation(path)


def test_a_disaggregation_that_is_cut_after_a_row_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "Mag_Dist-mean-0_2.csv"
    text = "#,,\"generated_by='OpenQuake'\"\nimt,iml,poe,mag,dist,mean\nPGA,0.5,1e-3,5.5,10,0.3"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="a last line without its end"):
        load_disaggregation(path)


def test_a_disaggregation_that_a_spreadsheet_rounded_is_refused(tmp_path: Path) -> None:
    """Of few decimals most are lost."""
    first = "generated_by='OpenQuake engine 3.16'"
    rare = [4.12e-4, 3.49e-5, 2.63e-5, 1.08e-5]
    path = disaggregated(tmp_path, {"mean": rare}, first)
    assert shares(path)[0] == pytest.approx(by_rates(rare)[0])
    disaggregated(tmp_path, {"mean": [round(share, 5) for share in rare]}, first)
    with pytest.raises(InputError, match="2 of 3 different values with one digit only"):
        load_disaggregation(path)


EDGES = "mag_bin_edges=[5.0, 6.0, 8.0], dist_bin_edges=[0.0, 20.0, 40.0]"
BINS = ("PGA,0.5,1e-3,5.5,10", "PGA,0.5,1e-3,7.0,10", "PGA,0.5,1e-3,5.5,30", "PGA,0.5,1e-3,7.0,30")


def disaggregated(
    folder: Path, columns: dict[str, list[float]], first: str = EDGES, name: str = "mean-0_2"
) -> Path:
    """Four bins of a level."""
    told = [f'#,,,,,"{first}"', ",".join(["imt,iml,poe,mag,dist", *columns])]
    cells = zip(*columns.values(), strict=True)
    told += [",".join([one, *map(str, own)]) for one, own in zip(BINS, cells, strict=True)]
    path = folder / f"Mag_Dist-{name}.csv"
    path.write_text("\n".join([*told, ""]), encoding="utf-8")
    return path


MEAN = [4e-4, 3e-4, 2e-4, 1e-4]


def by_rates(probabilities: list[float]) -> list[float]:
    """Shares of earthquakes that are Poissonian: a probability p is of -ln(1 - p) of them."""
    rates = [-math.log(1.0 - one) for one in probabilities]
    return [one / sum(rates) for one in rates]


def shares(path: Path) -> list[float]:
    """By magnitude, then distance."""
    (found,) = load_disaggregation(path).shares.tolist()
    return [found[at] for at in (0, 2, 1, 3)]


def test_of_other_statistics_the_mean_counts(tmp_path: Path) -> None:
    columns = {"mean": MEAN, "quantile-0.95": MEAN[::-1], "std": [1.0, 0.5, 0.5, 0.5]}
    path = disaggregated(tmp_path, columns)
    assert shares(path) == pytest.approx(by_rates(MEAN))
    assert load_disaggregation(path).unused == tuple(
        f"column {name} of {path.name} left out, as others count" for name in list(columns)[1:]
    )


def test_realizations_have_the_same_shares_whatever_the_years_of_their_probabilities(
    tmp_path: Path,
) -> None:
    """Each is of its own rates, of which the mean counts; two sum to no probability of 1."""
    rates = np.array([[2e-3, 1e-3, 1e-4, 1e-4], [1e-5, 1e-5, 2e-3, 1e-3]])
    for years in (1.0, 50.0, 1000.0, 5000.0):
        chances = -np.expm1(-rates * years)
        columns = {f"rlz{at}": row.tolist() for at, row in enumerate(chances)}
        path = disaggregated(tmp_path, columns, f"{EDGES}, weights=[0.75, 0.25]")
        mean = np.array([0.75, 0.25]) @ rates
        assert shares(path) == pytest.approx((mean / mean.sum()).tolist())


def test_realizations_count_by_the_weights_of_the_first_line(tmp_path: Path) -> None:
    columns = {"rlz0": MEAN, "rlz3": MEAN[::-1]}
    path = disaggregated(tmp_path, columns, f"{EDGES}, weights=[0.75, 0.25], rlz_ids=[0, 3]")
    rates = -np.log(1.0 - np.array([MEAN, MEAN[::-1]]))
    mean = np.array([0.75, 0.25]) @ rates
    assert shares(path) == pytest.approx((mean / mean.sum()).tolist())
    assert load_disaggregation(path).unused == ()
    turned = dict(reversed(columns.items()))
    path = disaggregated(tmp_path, turned, f"{EDGES}, weights=[0.25, 0.5]")
    assert [line.partition("0_2.csv ")[2] for line in load_disaggregation(path).unused] == [
        "are taken in the order of its columns, rlz3 and rlz0",
        "sum to 0.75, and count as shares of that",
    ]
    path = disaggregated(tmp_path, columns)
    assert shares(path) == pytest.approx((rates.mean(axis=0) / rates.mean(axis=0).sum()).tolist())
    assert "count alike" in load_disaggregation(path).unused[0]


@pytest.mark.parametrize(
    ("mean", "whole"),
    [
        (MEAN, None),
        ([4e-4, 3e-4, 3e-4, 1e-4], None),  # a level that is 10 % off, as between those of a curve
        ([0.4, 0.3, 0.2, 0.1], None),  # conditional, as of Mag_Dist-mean-traditional
        ([4e-4, 3e-4, 0.2, 1e-4], 0.201),
        ([4e-6, 3e-6, 2e-6, 1e-6], 1e-5),
    ],
)
def test_bins_that_are_not_their_whole_are_told(
    tmp_path: Path, mean: list[float], whole: float | None
) -> None:
    """All bins of a level have its probability, 1e-3: 1 - prod(1 - share)."""
    told = load_disaggregation(disaggregated(tmp_path, {"mean": mean})).unused
    assert [line.split(": ")[0] for line in told] == (
        [f"bins of 0.5 g have a probability of {whole:.3g} together, and a poe of 0.001"]
        if whole
        else []
    )


def test_a_bin_of_1_makes_no_level_conditional(tmp_path: Path) -> None:
    """Its sum is 1 to three digits, as of shares; that of the level beside it is not."""
    path = disaggregated(tmp_path, {"mean": [0.9994, 3e-4, 2e-4, 1e-4]})
    head, names, *rows = path.read_text(encoding="utf-8").splitlines()
    beside = [f"{one.replace('0.5', '0.4')},{share}" for one, share in zip(BINS, MEAN, strict=True)]
    path.write_text("\n".join([head, names, *rows, *beside, ""]), encoding="utf-8")
    (told,) = load_disaggregation(path).unused
    assert told.startswith("bins of 0.5 g have a probability of 0.999 together, and a poe of 0.001")


def test_shares_of_earthquakes_are_those_of_any_years(tmp_path: Path) -> None:
    """Of rare ones probabilities are rates; in 20,000 years some bins have 15 each."""
    path = disaggregated(tmp_path, {"mean": MEAN})
    of_a_year = shares(path)
    many = [1.0 - (1.0 - one) ** 20_000 for one in MEAN]
    assert shares(disaggregated(tmp_path, {"mean": many})) == pytest.approx(of_a_year)
    path = disaggregated(tmp_path, {"mean": [1.0, *many[1:]]})
    with pytest.raises(InputError, match="a bin of a probability of 1; it is below 1"):
        load_disaggregation(path)


def test_levels_of_no_years_are_not_held_against_the_curves_which_is_told(tmp_path: Path) -> None:
    model = curve_folder.load(written(tmp_path / "calc_7.hdf5"))
    found = load_disaggregation(disaggregated(tmp_path, {"mean": MEAN}))
    (said,) = curve_folder._other_rates(found, model)
    assert said.startswith("1 disaggregated level not held against the curves")


def test_without_a_poe_levels_are_exceeded_as_often_as_their_bins_say(tmp_path: Path) -> None:
    """As in OpenQuake's files of given levels; by it levels in another unit are told."""
    path = disaggregated(tmp_path, {"mean": MEAN}, f"investigation_time=50.0, {EDGES}")
    path.write_text(path.read_text(encoding="utf-8").replace(",1e-3,", ",nan,"), encoding="utf-8")
    none = (1 - 4e-4) * (1 - 3e-4) * (1 - 2e-4) * (1 - 1e-4)
    found = load_disaggregation(path)
    assert found.rates.tolist() == pytest.approx([-math.log(none) / 50.0])
    path = disaggregated(
        tmp_path, {"mean": [0.4, 0.3, 0.2, 0.1]}, f"investigation_time=50, {EDGES}"
    )
    path.write_text(path.read_text(encoding="utf-8").replace(",1e-3,", ",nan,"), encoding="utf-8")
    assert np.isnan(load_disaggregation(path).rates).all()  # shares of what exceeds it


def test_bins_of_a_level_with_another_poe_are_refused(tmp_path: Path) -> None:
    """The poe and the share of a row exchanged, of which its level's whole says nothing."""
    path = disaggregated(tmp_path, {"mean": [3e-4, 0.0, 5e-4, 2e-4]})
    lines = path.read_text(encoding="utf-8").splitlines()
    imt, iml, poe, *where, share = lines[3].split(",")
    lines[3] = ",".join([imt, iml, share, *where, poe])
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    with pytest.raises(InputError, match=r"poe: got none and 0.001 at 0.5 g; bins of a level"):
        load_disaggregation(path)


PLACE = f"{EDGES}, lon=-120.9, lat=35.2"


@pytest.mark.parametrize(
    ("columns", "first", "words"),
    [
        ({"mean": MEAN, "eps": MEAN}, EDGES, "eps: got the column; there are imt, iml"),
        ({"lon": MEAN, "lat": MEAN, "mean": MEAN}, EDGES, "lon: got the column"),
        ({"quantile-0.5": MEAN, "std": MEAN}, EDGES, "got quantile-0.5 and std alone"),
        ({"std": MEAN}, EDGES, "got std alone; shares are of the mean or of realizations"),
        ({"mean": MEAN}, EDGES.replace("8.0", "6.5"), "mag: got a bin at 7; by its first line"),
        ({"mean": MEAN}, EDGES.replace("40", "25"), "dist: got a bin at 30; by its first line"),
        ({"mean": MEAN}, EDGES.replace("20.0", "24.0"), "dist: got a bin at 30; by its first line"),
        ({"mean": MEAN}, EDGES.replace("20.0", "2000.0"), "dist: got a bin at 10; by its first"),
        ({"mean": MEAN}, EDGES.replace("40.0", "x"), "dist.2: got ' x'"),
        ({"mean": MEAN}, f"{EDGES}, lon=nan, lat=35.2", "lon: got 'nan'; "),
        ({"mean": MEAN}, f"{EDGES}, lon=-120.9, lat=inf", "lat: got 'inf'; "),
        (
            {"rlz0": MEAN},
            f"{EDGES}, weights=[0.25, 0.75]",
            "weights: got 2 in row 1; there is one for each of 1 realizations",
        ),
        (
            {"rlz0": MEAN, "rlz1": MEAN},
            f"{EDGES}, weights=[1.0]",
            "weights: got 1 in row 1; there is one for each of 2 realizations",
        ),
        (
            {"rlz0": MEAN, "rlz1": MEAN},
            f"{EDGES}, weights=[0.9, 0.9]",
            "weights: got a sum of 1.8; they sum to 1 at most",
        ),
        (
            {"rlz0": MEAN, "rlz-0": MEAN},
            f"{EDGES}, weights=[0.5, 0.5]",
            "a realization has one column",
        ),
        (
            {"rlz0": MEAN, "rlz1": MEAN},
            f"{EDGES}, weights=[1.0, x]",
            "weights.1: got ' x' in row 1",
        ),
    ],
)
def test_columns_and_bins_that_are_none_are_refused(
    tmp_path: Path, columns: dict[str, list[float]], first: str, words: str
) -> None:
    with pytest.raises(InputError, match=re.escape(words)) as error:
        load_disaggregation(disaggregated(tmp_path, columns, first))
    assert str(error.value).count("\n") == 0


@pytest.mark.parametrize(
    ("name", "first", "words"),
    [
        ("mean-1_2", EDGES, "0.5 g, M 5.5, 10 km in two files; a bin is in one file; name one of"),
        ("mean-1_2", PLACE.replace("35.2", "36.2"), "lat: got 35.2 of Mag_Dist-mean-0_2.csv and"),
        ("mean-0_3", EDGES, "number: got 2 of Mag_Dist-mean-0_2.csv and 3 of Mag_Dist-mean-0_3"),
    ],
)
def test_disaggregations_of_two_places_or_calculations_are_refused(
    tmp_path: Path, name: str, first: str, words: str
) -> None:
    disaggregated(tmp_path, {"mean": MEAN}, PLACE)
    disaggregated(tmp_path, {"mean": MEAN}, first, name)
    with pytest.raises(InputError, match=re.escape(words)) as error:
        load_disaggregation(tmp_path)
    assert str(error.value).count("\n") == 0


@pytest.mark.parametrize(
    "name", ["Mag_Dist.csv", "rlz-0-PGA-sid-0-poe-0_Mag_Dist_1.csv", "Mag_Dist-mean-0_1.CSV"]
)
def test_a_disaggregation_of_another_name_is_told(tmp_path: Path, name: str) -> None:
    """Beside curves, where PGV/PGA would be another without it."""
    for path in MADE_UP.glob("*.csv"):
        shutil.copy(path, tmp_path / path.name)
    disaggregated(tmp_path, {"mean": MEAN}).rename(tmp_path / name)
    given = (f"hazard.curves={tmp_path}", "hazard.age={kind: normal, mean: 5000}")
    site = load_site("double_rock", None, given)
    found = curve_folder.find(site.config.hazard, site)
    assert found.disaggregated is None
    (tmp_path / name).unlink()
    before = curve_folder.find(site.config.hazard, site).digests()
    assert found.digests() != before  # where it is added later, it is told of as well
    told = f"{name!r} left out, as nothing reads a file of that name there"
    assert [line for line in found.unused if "nothing reads" in line] == [told]


def test_weights_count_beside_a_file_of_their_name_that_nothing_reads(tmp_path: Path) -> None:
    """In the folder of the disaggregation, which has realizations of its own."""
    curves, other = tmp_path / "curves", tmp_path / "disaggregation"
    shutil.copytree(MADE_UP, curves)
    other.mkdir()
    disaggregated(other, {"mean": MEAN})
    weights = Path(shutil.copy(curves / "realizations_1.csv", other)).name
    given = (f"hazard.curves={curves}", "hazard.age={kind: normal, mean: 5000}")
    site = load_site("double_rock", None, (*given, f"hazard.disaggregation={other}"))
    found = curve_folder.find(site.config.hazard, site)
    assert found.unread == (weights,)
    before = found.digests()
    (curves / weights).write_text((curves / weights).read_text(encoding="utf-8") + "\n")
    assert found.digests() != before


@pytest.mark.parametrize("name", ["PGV/{}", "curve-{}"])
def test_curves_of_pgv_of_another_name_or_place_are_told(tmp_path: Path, name: str) -> None:
    """All nine and the mean, without which PGV/PGA is assumed."""
    (tmp_path / "PGV").mkdir()
    for path in MADE_UP.glob("*.csv"):
        new = name.format(path.name) if path.match("hazard_curve-*PGV*") else path.name
        shutil.copy(path, tmp_path / new)
    given = (f"hazard.curves={tmp_path}", "hazard.age={kind: normal, mean: 5000}")
    site = load_site("double_rock", None, given)
    first = ("mean", "rlz-000", "rlz-001")
    shown = ", ".join(repr(name.format(f"hazard_curve-{one}-PGV_1.csv")) for one in first)
    assert [one for one in curve_folder.find(site.config.hazard, site).unused if "PGV" in one] == [
        f"{shown} and 7 more left out, as nothing reads a file of that name there"
    ]


@pytest.mark.parametrize(
    "name",
    ["pgv/curves.csv", "PGV/Curves.csv", "PGV.csv", "PGV/curves.csv.txt", "PGV/total/curves.csv"],
)
def test_a_curve_of_pgv_of_nshmp_of_another_name_is_told(tmp_path: Path, name: str) -> None:
    path = nshmp(tmp_path)
    of_pga = path / "PGA" / "curves.csv"
    (path / name).parent.mkdir(exist_ok=True, parents=True)
    shutil.copy(of_pga, path / name)
    given = (f"hazard.curves={path}", "hazard.age={kind: normal, mean: 5000}")
    site = load_site("double_rock", None, given)
    (told,) = (
        one for one in curve_folder.find(site.config.hazard, site).unused if "PGV" in one.upper()
    )
    assert told == f"'{name}' left out, as nothing reads a file of that name there"


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
    assert not list(curve_folder._other_rates(found, curve_folder.load(SHARED)))


@pytest.mark.parametrize(
    ("level", "years", "told"),
    [(0.5, 5.0, False), (0.5, 50.0, True), (0.5, 1.0, True), (4.9, 5.0, True), (4.9, 500.0, False)],
)
def test_a_level_that_the_curves_exceed_far_more_or_less_often_is_told(
    tmp_path: Path, level: float, years: float, told: bool
) -> None:
    """By the curves 0.5 g is exceeded 1 to 2 times in 10,000 years, by 0.001 in so many years.

    They end at 1 g, which is exceeded 2 to 4 times in 100,000 years.
    """
    model = curve_folder.load(written(tmp_path / "calc_7.hdf5"))
    first = f"{EDGES}, investigation_time={years}"
    path = disaggregated(tmp_path, {"mean": MEAN}, first)
    path.write_text(path.read_text().replace("PGA,0.5,", f"PGA,{level},"))
    found = load_disaggregation(path)
    assert found.rates.tolist() == pytest.approx([1e-3 / years], rel=1e-3)
    lines = list(curve_folder._other_rates(found, model))
    words = f"disaggregated {level} g is exceeded"
    assert [line.startswith(words) for line in lines] == [True] * told
