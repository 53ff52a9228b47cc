"""Files of hazard curves: three spellings of the same curves, and what is refused."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline import ROOT
from pipeline.config.layers import load_site
from pipeline.config.problems import InputError
from pipeline.stages.hazard import curve_folder
from tests.support.bad_input import bounded
from vsr_core import GRAVITY

LEVELS = [0.01, 0.1, 1.0]
RATES = {0: [0.2, 4e-3, 2e-5], 1: [0.3, 8e-3, 0.0]}
WEIGHTS = {0: 0.6, 1: 0.4}
YEARS = 50.0

MADE_UP = ROOT / "data" / "raw" / "hazard" / "made_up"
SHARED = Path(__file__).parents[5] / "shared" / "data" / "hazard" / "curves"


def present(number: int, rates: list[float]) -> str:
    names = ",".join(f"poe-{level:.7f}" for level in LEVELS)
    poes = ",".join(f"{-math.expm1(-YEARS * rate):.12E}" for rate in rates)
    told = f"kind='rlz-{number:03d}', investigation_time={YEARS}, imt='PGA'"
    first = f"#,,,,,\"generated_by='OpenQuake engine 3.26.2', {told}\""
    return f"{first}\nlon,lat,depth,{names}\n-120.9,35.2,0.0,{poes}\n"


def older(number: int, rates: list[float]) -> str:
    names = ",".join(f"PGA-{level}:float32" for level in LEVELS)
    poes = ",".join(f"{-math.expm1(-YEARS * rate):.12E}" for rate in rates)
    first = f"# rlz-{number:03d}, investigation_time={YEARS},imt=PGA"
    return f"{first}\nlon:float32,lat:float32,{names}\n-120.9,35.2,{poes}\n"


def written(folder: Path, spelt: Callable[[int, list[float]], str] = present) -> Path:
    for number, rates in RATES.items():
        path = folder / f"hazard_curve-rlz-{number:03d}-PGA_1.csv"
        path.write_text(spelt(number, rates), encoding="utf-8")
    name = "rlz_id" if spelt is present else "ordinal"
    lines = [f"{name},branch_path,weight", *(f"{n},A~{n},{w}" for n, w in WEIGHTS.items())]
    (folder / "realizations_1.csv").write_text("\n".join([*lines, ""]), encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("rates", "told"),
    [
        ([0.21, 4.123e-3, 2.1e-5], []),
        ([0.2123, 0.2123, 2.1e-5], []),  # all earthquakes exceed the first two levels
        (
            [0.21, 4.123e-3, 4.123e-3],
            ["1 value of PGA in curves.csv as at the level below: values may be held"],
        ),
        ([0.21, 4.1e-3, 4.1e-3], []),  # of few digits
    ],
)
def test_rates_that_stay_from_level_to_level_are_told(
    tmp_path: Path, rates: list[float], told: list[str]
) -> None:
    """As where cells were filled from those beside them."""
    (tmp_path / "PGA").mkdir()
    text = f"name,lon,lat,{','.join(map(str, LEVELS))}\na,-120.9,35.2,{','.join(map(str, rates))}\n"
    (tmp_path / "PGA" / "curves.csv").write_text(text, encoding="utf-8")
    assert list(curve_folder.load(tmp_path).unused) == told


@pytest.mark.parametrize(("poe", "is_told"), [("0.999999", False), ("0.876543", True)])
def test_probabilities_near_1_have_few_digits(tmp_path: Path, poe: str, is_told: bool) -> None:
    """Of seven that OpenQuake writes, six are nines."""
    (tmp_path / "hazard_curve-mean-PGA_1.csv").write_text(
        "#,,\"generated_by='OpenQuake engine 3.26', investigation_time=450.0, kind='mean', "
        "imt='PGA'\"\nlon,lat,depth,poe-0.005,poe-0.01,poe-0.02,poe-0.5\n"
        f"-120.9,35.2,0,9.999999E-01,{poe},{poe},1.23456E-02\n",
        encoding="utf-8",
    )
    told = [one for one in curve_folder.load(tmp_path).unused if "may be held" in one]
    assert bool(told) == is_told


@pytest.mark.parametrize("spelt", [present, older])
def test_rates_and_weights_are_read(
    tmp_path: Path, spelt: Callable[[int, list[float]], str]
) -> None:
    model = curve_folder.load(written(tmp_path, spelt))
    assert model.location == (-120.9, 35.2)
    assert [(one.name, one.path, one.weight) for one in model.branches] == [
        ("0", "A~0", 0.6),
        ("1", "A~1", 0.4),
    ]
    np.testing.assert_allclose(model.branches[0].pga.levels, GRAVITY * np.array(LEVELS))
    np.testing.assert_allclose(model.branches[0].pga.rates, RATES[0], rtol=1e-6)
    # A level that is never exceeded ends the curve.
    np.testing.assert_allclose(model.branches[1].pga.rates, RATES[1][:2], rtol=1e-6)


def test_rates_of_nshmp_haz(tmp_path: Path) -> None:
    (tmp_path / "PGA").mkdir()
    text = "name,lon,lat,0.01,0.1,1.0\nhere,-120.9,35.2,0.20,4.0e-3,2.0e-5\n"
    (tmp_path / "PGA" / "curves.csv").write_text(text, encoding="utf-8")
    (only,) = curve_folder.load(tmp_path).branches
    assert (only.name, only.weight) == ("mean", 1.0)
    np.testing.assert_allclose(only.pga.rates, RATES[0])


FIRST = "hazard_curve-rlz-000-PGA_1.csv"


@pytest.mark.parametrize(
    ("mean", "off"),
    [
        ([0.24, 5.6e-3, 1.2e-5], ""),  # of rates
        (None, ""),  # of probabilities
        ([0.24, 5.6e-3, 2e-5], "40 %"),  # at the last level the mean is 0.6 of that
        ([0.24, 5.7e-3, 1.2e-5], "1.52 %"),  # (exp(-0.28) - exp(-0.285)) / (1 - exp(-0.285))
    ],
)
def test_a_mean_curve_that_is_none_of_the_realizations_is_told(
    tmp_path: Path, mean: list[float] | None, off: str
) -> None:
    if mean is None:
        poes = [-np.expm1(-YEARS * np.array(RATES[number])) for number in RATES]
        mean = (-np.log1p(-(0.6 * poes[0] + 0.4 * poes[1])) / YEARS).tolist()
    curve = present(0, mean).replace("rlz-000", "mean")
    (written(tmp_path) / "hazard_curve-mean-PGA_1.csv").write_text(curve, encoding="utf-8")
    told = [line for line in curve_folder.load(tmp_path).unused if "mean" in line]
    assert len(told) == bool(off)
    assert all(f"is up to {off} off the mean of the realizations" in line for line in told)


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        (FIRST, "investigation_time=50.0", "x=1", "years of the probabilities"),
        (FIRST, "imt='PGA'", "imt='SA(0.2)'", "the file name says PGA"),
        (FIRST, "-120.9,35.2", "-120.9,36.2", "all curves are of one site"),
        (FIRST, "-120.9,35.2,0.0,", "-120.9,35.2,0.0,1.0,", "7 fields in row 1"),
        (FIRST, "1.812692469220E-01", "1.0", "rises to 1"),
        (FIRST, "investigation_time=50.0", "risk_investigation_time=50.0", "got nothing"),
        (FIRST, "kind=", "investigation_time=1.0, kind=", "investigation_time: got "),
        (FIRST, "imt='PGA'", "imt='PGA', imt='SA(0.2)'", "imt: got PGA and SA(0.2); the"),
        (FIRST, "\nlon", "\n# investigation_time=1.0\nlon", "investigation_time: got "),
        (FIRST, "E-04\n", "E-04\n# investigation_time=1.0\n", "investigation_time: got "),
        (
            "realizations_1.csv",
            "rlz_id",
            "# checksum=1, checksum=2\nrlz_id",
            "checksum: got 1 and 2",
        ),
        (
            FIRST,
            "-120.9,35.2,0.0,",
            "-120.9,35.2,10.0,",
            "got a site, depth 0, and elsewhere a site, depth 10",
        ),
        (FIRST, "investigation_time=50.0", "investigation_time=1e-300", "years: got '1e-300'"),
        (FIRST, "investigation_time=50.0", "investigation_time=50,0", "years: got '50,0'"),
        (FIRST, "investigation_time=50.0", "investigation_time=5.0", "50 years, and elsewhere 5"),
        (FIRST, "poe-0.1000000", "poe-nan", "levels.1: got 'nan'"),
        (FIRST, "poe-0.1000000", "SA(0.2)-0.1", "poe-0.1 for a level of PGA"),
        (FIRST, "poe-0.1000000", "PGV-0.1", "poe-0.1 for a level of PGA"),
        (FIRST, "-120.9,", "nan,", "lon: got 'nan'"),
        (FIRST, "35.2,", "1e300,", "lat: got '1e300'"),
        (FIRST, "9.995001666250E-04\n", "9.995001666250E-0", "a last line that ends in"),
        (FIRST, "9.995001666250E-04", "nan", "values.2: got 'nan'"),
        (FIRST, "1.812692469220E-01", "-0.1", "values.1: got '-0.1'"),
        (FIRST, "1.812692469220E-01", "0.0", "not positive"),
        (FIRST, "lon,lat,depth", "lon,lon,depth", "lon: got a column twice"),
        (FIRST, "poe-0.1000000", "poe-0.0100000:float32", "poe-0.0100000: got a column twice"),
        (FIRST, "poe-0.1000000", "poe-0:.1000000", "levels.1: got '0:.1000000'"),
        ("realizations_1.csv", "branch_path", "ordinal", "rlz_id: got a column twice"),
        ("realizations_1.csv", "branch_path", "weight:float32", "weight: got a column twice"),
        ("realizations_1.csv", "1,A~1,0.4", "1,A~1,0.4\n0,A~0,0.9", "0 twice"),
        ("realizations_1.csv", "1,A~1,0.4", "1,A~1,-0.4", "weight: got '-0.4' in row 2"),
        ("realizations_1.csv", "A~1", "A" * 200_000, "field larger"),
        ("realizations_1.csv", "0.6\n1,A~1,0.4", "1.4\n1,A~1,-0.4", "weight: got '1.4' in row 1"),
        (FIRST, "poe-0.0100000", "poe-9.0", "ascend"),
        ("realizations_1.csv", "0.4", "0.3", "sum to 1"),
        ("realizations_1.csv", "weight", "gewicht", "rlz_id, branch_path, weight"),
        ("realizations_1.csv", "\n1,", "\n2,", "a curve of PGA and a weight"),
        ("realizations_1.csv", "0.6", "half", "weight: got 'half' in row 1"),
    ],
)
def test_what_breaks_a_rule_is_refused_in_one_line(
    tmp_path: Path, file: str, old: str, new: str, words: str
) -> None:
    path = written(tmp_path) / file
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(words)) as error:
        curve_folder.load(tmp_path)
    assert str(error.value).count("\n") == 0
    assert str(tmp_path) in str(error.value)


@pytest.mark.parametrize("kind", ["quantile-0.95", "rlz-000", "std"])
def test_an_older_curve_that_is_not_what_its_name_says_is_refused(
    tmp_path: Path, kind: str
) -> None:
    """Older files begin with what they are of, without a key."""
    path = tmp_path / "hazard_curve-mean-PGA_1.csv"
    mean = older(0, RATES[0]).replace("rlz-000", "mean")
    path.write_text(mean, encoding="utf-8")
    assert curve_folder.load(tmp_path).branches
    path.write_text(mean.replace("mean", kind), encoding="utf-8")
    with pytest.raises(InputError, match=f"kind: got {kind}; the file name says mean"):
        curve_folder.load(tmp_path)


@pytest.mark.parametrize(
    ("factor", "names", "words"),
    [
        (981.0, "*.csv", "levels: got levels from 9.81 to 981"),
        (981.0, FIRST, "levels: got levels from 9.81 to 981"),
        (9.81, FIRST, "other levels than"),
        (1e-3, "hazard*.csv", "levels from 1e-05 to 0.001"),
    ],
)
def test_levels_in_another_unit_are_refused(
    tmp_path: Path, factor: float, names: str, words: str
) -> None:
    for path in written(tmp_path).glob(names):
        text = re.sub(
            r"poe-([0-9.]+)",
            lambda level: f"poe-{factor * float(level[1])}",
            path.read_text(encoding="utf-8"),
        )
        path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(words)):
        curve_folder.load(tmp_path)


@pytest.mark.parametrize("highest", [0.9, 1.6, 2.0])
@pytest.mark.parametrize("source", [MADE_UP, SHARED])
def test_levels_in_m_s2_of_all_branches_are_refused(
    tmp_path: Path, source: Path, highest: float
) -> None:
    """Of curves of PGA alone that end below 2 g, so that each alone could be one in g."""
    if not source.is_dir():
        pytest.skip("the folder of example curves is not here")
    shutil.copy(source / "realizations_1.csv", tmp_path)
    for factor in (1.0, GRAVITY):
        for path in source.glob("hazard_curve-rlz-*-PGA_1.csv"):
            first, names, values = path.read_text(encoding="utf-8").splitlines()
            levels = [float(name.removeprefix("poe-")) for name in names.split(",")[3:]]
            kept = 3 + sum(level <= highest for level in levels)
            told = ",".join(
                ["lon,lat,depth", *(f"poe-{factor * level:.7f}" for level in levels[: kept - 3])]
            )
            lines = [first, told, ",".join(values.split(",")[:kept]), ""]
            (tmp_path / path.name).write_text("\n".join(lines), encoding="utf-8")
        if factor == 1.0:
            assert len(curve_folder.load(tmp_path).branches) == 9
    with pytest.raises(InputError, match=r"convert levels in m/s2 to g|correct the units"):
        curve_folder.load(tmp_path)


def shipped(folder: Path) -> Path:
    """The first two of the curves that OpenQuake made, of PGA and PGV, with weights."""
    for measure in ("PGA", "PGV"):
        for kind in ("mean", "rlz-000", "rlz-001"):
            shutil.copy(MADE_UP / f"hazard_curve-{kind}-{measure}_1.csv", folder)
    first = (MADE_UP / "realizations_1.csv").read_text(encoding="utf-8").splitlines()[:2]
    text = "\n".join([*first, "0,A~0,0.6", "1,A~1,0.4", ""])
    (folder / "realizations_1.csv").write_text(text, encoding="utf-8")
    return folder


def renamed(folder: Path, old: str, new: str) -> None:
    for path in folder.glob(f"{old}*"):
        path.rename(folder / path.name.replace(old, new))


def edited(folder: Path, name: str, old: str, new: str) -> None:
    text = (folder / name).read_text(encoding="utf-8")
    assert re.search(old, text)
    (folder / name).write_text(re.sub(old, new, text, count=1), encoding="utf-8")


SECOND = "hazard_curve-rlz-001-PGA_1.csv"
OF_PGV = "hazard_curve-rlz-000-PGV_1.csv"
MIXED: dict[str, tuple[Callable[[Path], object], str]] = {
    "twice": (lambda at: shutil.copy(at / FIRST, at / SECOND), "kind: got rlz-000; the file name"),
    "quantile": (
        lambda at: shutil.copy(MADE_UP / "quantile_curve-0.95-PGA_1.csv", at / SECOND),
        "kind: got quantile-0.95; the file name says rlz-001",
    ),
    "number": (lambda at: renamed(at, SECOND, SECOND.replace("_1", "_2")), "and 2 of hazard_curve"),
    "weights": (lambda at: renamed(at, "realizations_1", "realizations_2"), "2 of realizations_2"),
    "checksum": (lambda at: edited(at, FIRST, "sum=3", "sum=4"), "checksum: got 3673934075 of"),
    "checksum of PGV": (lambda at: edited(at, OF_PGV, "sum=3", "sum=4"), "and 4673934075 of"),
    "checksum of weights": (
        lambda at: edited(at, "realizations_1.csv", "sum=3", "sum=4"),
        "and 4673934075 of realizations_1.csv",
    ),
    "place of PGV": (
        lambda at: [edited(at, path.name, r"\n-120\.", "\n-121.") for path in at.glob("*PGV*")],
        "all curves are of one site",
    ),
    "years of PGV": (
        lambda at: [edited(at, path.name, "time=1.0", "time=2.0") for path in at.glob("*PGV*")],
        "2 years, and elsewhere 1",
    ),
    "no PGV": (lambda at: (at / OF_PGV).unlink(), "PGV: got no curve of realization 0"),
    "PGV in capitals": (lambda at: renamed(at, OF_PGV, f"{OF_PGV[:-3]}CSV"), "of realization 0"),
    "only PGV": (
        lambda at: [path.unlink() for path in at.glob("*-rlz-*PGA*")],
        "realization 0 without curve or weight",
    ),
}


@pytest.mark.parametrize("mixed", MIXED)
def test_curves_of_two_calculations_or_kinds_are_refused(tmp_path: Path, mixed: str) -> None:
    change, words = MIXED[mixed]
    assert len(curve_folder.load(shipped(tmp_path)).branches) == 2
    change(tmp_path)
    with pytest.raises(InputError, match=re.escape(words)) as error:
        curve_folder.load(tmp_path)
    assert str(error.value).count("\n") == 0


def test_curves_that_are_left_out_are_named(tmp_path: Path) -> None:
    """A second download; weights, where realizations are lost; the mean, where PGV of them is."""
    shipped(tmp_path)
    again = f"{FIRST[:-4]} (1).csv"
    shutil.copy(tmp_path / FIRST, tmp_path / again)
    given = (f"hazard.curves={tmp_path}", "hazard.age={kind: normal, mean: 5000}")
    site = load_site("double_rock", None, given)
    said = f"'{again}' left out, as nothing reads a file of that name there"
    assert said in curve_folder.find(site.config.hazard, site).unused
    (tmp_path / again).unlink()
    for path in tmp_path.glob("*-rlz-*PGV*"):
        path.unlink()
    said = "the mean curve of PGV left out, as no realization has one"
    assert curve_folder.load(tmp_path).unused[0] == said
    for path in tmp_path.glob("*-rlz-*"):
        path.unlink()
    said = "realizations_1.csv left out, as the mean is the only curve"
    assert curve_folder.load(tmp_path).unused[0] == said


@pytest.mark.filterwarnings("error")
def test_realizations_without_weight_are_refused_in_one_line(tmp_path: Path) -> None:
    """Nor is their mean looked for."""
    path = shipped(tmp_path) / "realizations_1.csv"
    path.write_text(path.read_text().replace(",0.6", ",0").replace(",0.4", ",0"))
    with pytest.raises(InputError, match="sum to 1"):
        curve_folder.load(tmp_path)


@pytest.mark.parametrize(("factor", "told"), [(0.2, False), (0.02, True)])
def test_a_branch_whose_rates_are_of_other_years_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, factor: float, told: bool
) -> None:
    """The last of three; the first two are exceeded 0.2 and 0.3 times a year."""
    monkeypatch.setitem(RATES, 2, [factor * rate for rate in RATES[0]])
    for number, weight in enumerate((0.4, 0.4, 0.2)):
        monkeypatch.setitem(WEIGHTS, number, weight)
    said = curve_folder.load(written(tmp_path)).unused
    assert [line for line in said if "middle of all branches" in line] == [
        "branch 2 exceeds the first level of PGA 0.02 times as often as the middle of all "
        "branches: its years may be others"
    ] * told


def told_of_pgv(folder: Path, change: Callable[[float, int], float], words: str) -> list[str]:
    """What is told where one of nine branches has other probabilities of PGV, and no mean curve."""
    for pattern in ("realizations_1.csv", "*-rlz-*"):
        for path in MADE_UP.glob(pattern):
            shutil.copy(path, folder)
    path = folder / "hazard_curve-rlz-003-PGV_1.csv"
    head, names, row = path.read_text().splitlines()
    where, shares = row.split(",")[:3], map(float, row.split(",")[3:])
    changed = [str(change(share, level)) for level, share in enumerate(shares)]
    path.write_text("\n".join([head, names, ",".join([*where, *changed]), ""]))
    return [line for line in curve_folder.load(folder).unused if words in line]


@pytest.mark.parametrize(("factor", "told"), [(1.0, 0), (0.1, 1)])
def test_a_branch_whose_rates_of_pgv_are_of_other_years_is_told(
    tmp_path: Path, factor: float, told: int
) -> None:
    said = told_of_pgv(tmp_path, lambda share, level: factor * share, "the first level")
    assert len(said) == told
    assert all(line.startswith("branch 3 exceeds the first level of PGV") for line in said)


def test_levels_of_pgv_that_nothing_exceeds_are_counted(tmp_path: Path) -> None:
    """As of PGA: a curve that ends early has another PGV/PGA."""
    said = told_of_pgv(tmp_path, lambda share, level: share * (level < 12), "of PGV that nothing")
    rows = [path.read_text().splitlines()[2].split(",") for path in tmp_path.glob("*PGV*")]
    none = sum(float(share) == 0.0 for row in rows for share in row[3:])
    assert said == [f"{none} levels of PGV that nothing exceeds left out, at ends of curves"]


def test_curves_of_two_programs_in_one_folder_are_refused(tmp_path: Path) -> None:
    nshmp(tmp_path, "0.11,0.021,0.0031,0.00041")
    for path in MADE_UP.glob("hazard_curve-mean-*"):
        shutil.copy(path, tmp_path)
    with pytest.raises(InputError, match=r"got curves of OpenQuake and PGA/curves.csv; a folder"):
        curve_folder.load(tmp_path)


@pytest.mark.parametrize("program", ["OpenQuake", "nshmp-haz"])
def test_what_is_read_is_in_the_key_and_other_files_are_named(tmp_path: Path, program: str) -> None:
    """With what the other program leaves beside it."""
    if program == "OpenQuake":
        shipped(tmp_path)
        others = "SA0P2/curves.csv", "PGV.csv"
    else:
        nshmp(tmp_path, "0.11,0.021,0.0031,0.00041")
        others = "realizations_1.csv", "hazard_curve-rlz-000-SA(0.2)_1.csv", "PGV.csv"
    own = {path.relative_to(tmp_path) for path in tmp_path.glob("**/*.csv")}
    for name in (*others, "about.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("a note\n")
    given = (f"hazard.curves={tmp_path}", "hazard.age={kind: normal, mean: 5000}")
    site = load_site("double_rock", None, given)
    found = curve_folder.find(site.config.hazard, site)
    before, read = found.digests(), set()
    for path in (one for one in tmp_path.glob("**/*") if one.is_file()):
        content = path.read_bytes()
        path.write_bytes(content + b"\n")
        if found.digests() != before:
            read.add(path.relative_to(tmp_path))
        path.write_bytes(content)
    assert read == own | {Path("about.txt")}
    assert found.unread == tuple(name for name in sorted(others) if "SA" not in name)


@pytest.mark.parametrize("link", ["PGV", "PGV/curves.csv"])
def test_curves_of_pgv_behind_a_link_that_leads_nowhere(tmp_path: Path, link: str) -> None:
    """As of a disk that is not there: without it PGV/PGA is not that of the site."""
    path = nshmp(tmp_path, "0.11,0.021,0.0031,0.00041") / link
    path.parent.mkdir(exist_ok=True)
    path.symlink_to("elsewhere")
    with pytest.raises(InputError, match=f"got {path.name}, a link that leads nowhere; it leads"):
        curve_folder.load(tmp_path)


def nshmp(folder: Path, rates: str, levels: str = "0.01,0.1,0.5,1.0") -> Path:
    (folder / "PGA").mkdir()
    text = f"name,lon,lat,{levels}\nhere,-120.9,35.2,{rates}\n"
    (folder / "PGA" / "curves.csv").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("as_saved", ["-120.90,35.20,0,", "239.1,35.2,0.00000,", "-120.9,35.2,,"])
def test_a_place_is_one_however_it_is_written(tmp_path: Path, as_saved: str) -> None:
    path = written(tmp_path) / FIRST
    comment = f"# of 2026, investigation_time={YEARS}\n"
    path.write_text(path.read_text().replace("-120.9,35.2,0.0,", as_saved) + comment)
    assert len(curve_folder.load(tmp_path).branches) == 2


def test_curves_of_two_places_of_nshmp_haz_are_refused(tmp_path: Path) -> None:
    nshmp(tmp_path, "0.11,0.021,0.0031,0.00041")
    (tmp_path / "PGV").mkdir()
    text = "name,lon,lat,1,10,50,100\nhere,-120.9,35.2,0.11,0.021,0.0031,0.00041\n"
    path = tmp_path / "PGV" / "curves.csv"
    path.write_text(text)
    assert curve_folder.load(tmp_path).branches[0].pgv is not None
    path.write_text(text.replace("here", "there"))
    with pytest.raises(InputError, match="got there, depth 0, and elsewhere here, depth 0; all"):
        curve_folder.load(tmp_path)


@pytest.mark.parametrize(
    ("spelling", "few"),
    [
        (".6E", 0),
        (".2g", 0),
        ("", 0),  # as short as it may be: one of four happens to be round
        (".2f", 1),  # 0.16, 0.01, 0.00, 0.00
        (".0E", 4),
        (".1g", 4),
    ],
)
def test_values_that_were_rounded_to_one_digit_are_refused(
    tmp_path: Path, spelling: str, few: int
) -> None:
    """Rates of one place, as programs and spreadsheets write them."""
    rates = [0.158, 0.0141, 0.00117, 0.0004]
    folder = nshmp(tmp_path, ",".join(format(rate, spelling) for rate in rates))
    if not few:
        np.testing.assert_allclose(curve_folder.load(folder).branches[0].pga.rates, rates, 0.05)
        return
    with pytest.raises(InputError, match="different values with one digit only") as told:
        curve_folder.load(folder)
    assert f"got {few} of" in str(told.value)


@pytest.mark.parametrize(
    ("rates", "words"),
    [
        ("0.1,nan,1e-3,1e-4", "values.1: got 'nan'"),
        ("0.1,-0.01,1e-3,1e-4", "values.1: got '-0.01'"),
        ("0.1,0.01,0,1e-4", "not positive"),
        ("inf,0.01,1e-3,1e-4", "values.0: got 'inf'"),
        ("1e306,1e300,1e299,1e298", "equal to 1000"),
        ("0.9,0.3,0.1,0.03", "0.03 times a year; 1 is exceeded at most 0.01 times"),
        ("0.1,0.01,1e-3", "6 fields in row 1"),
        ("0.1,0.01,1e-3,1e-4,1e-5", "8 fields in row 1"),
    ],
)
def test_rates_that_are_none_are_refused(tmp_path: Path, rates: str, words: str) -> None:
    with pytest.raises(InputError, match=re.escape(words)):
        curve_folder.load(nshmp(tmp_path, rates))


@pytest.mark.parametrize("levels", ["0.01,0.1,1.0,0.5", "0.01,0.1,1.0,1.00"])
@pytest.mark.parametrize("rates", ["0.1,0.01,1e-4,1e-3", "0.1,0.01,1e-4,0"])
def test_levels_out_of_order_are_refused_though_nothing_exceeds_the_last(
    tmp_path: Path, levels: str, rates: str
) -> None:
    with pytest.raises(InputError, match="levels out of order; they ascend"):
        curve_folder.load(nshmp(tmp_path, rates, levels))


def test_columns_that_differ_by_case_alone_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="1e-1: got a column twice"):
        curve_folder.load(nshmp(tmp_path, "0.1,0.01,1e-3,1e-4", "0.01,1e-1,1E-1,1.0"))


def test_levels_that_are_never_exceeded_end_a_curve_and_are_counted(tmp_path: Path) -> None:
    model = curve_folder.load(nshmp(tmp_path, "0.10,0.010,0,0"))
    np.testing.assert_allclose(model.branches[0].pga.rates, [0.1, 0.01])
    assert model.unused == ("2 levels of PGA that nothing exceeds left out, at ends of curves",)


def test_a_realization_without_weight_is_no_branch_and_counted(tmp_path: Path) -> None:
    path = written(tmp_path) / "realizations_1.csv"
    path.write_text("rlz_id,branch_path,weight\n0,A~0,0.0\n1,A~1,1.0\n", encoding="utf-8")
    model = curve_folder.load(tmp_path)
    assert [one.name for one in model.branches] == ["1"]
    assert model.unused[0] == "1 realization of weight 0 left out"


@pytest.mark.parametrize("name", [FIRST, "realizations_1.csv", "about.txt"])
def test_what_is_no_file_of_text_is_refused(tmp_path: Path, name: str) -> None:
    path = written(tmp_path) / name
    for make in (
        lambda: path.mkdir(),
        lambda: path.write_bytes(b"caf\xe9"),
        lambda: path.write_bytes(b"a,b\0\n1,2\n"),
    ):
        path.unlink(missing_ok=True)
        make()
        read = curve_folder.about if name == "about.txt" else curve_folder.load
        with bounded(seconds=1.0, mebibytes=50.0), pytest.raises(InputError, match=name):
            read(tmp_path)
        if path.is_dir():
            path.rmdir()


def test_a_folder_without_curves(tmp_path: Path) -> None:
    for wrong in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(InputError):
            curve_folder.load(wrong)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the folder of example curves is not here")
def test_curves_that_openquake_wrote() -> None:
    """The mean that it wrote itself is the weighted mean of the branches' probabilities."""
    model = curve_folder.load(SHARED)
    assert len(model.branches) == 9
    text = (SHARED / "hazard_curve-mean-PGA_1.csv").read_text(encoding="utf-8").splitlines()
    mean = np.array([float(field) for field in text[2].split(",")[3:]])
    number = min(len(one.pga.rates) for one in model.branches)
    found = sum(one.weight * -np.expm1(-one.pga.rates[:number]) for one in model.branches)
    np.testing.assert_allclose(found, mean[:number], rtol=2e-5)
    assert all(one.pgv is not None for one in model.branches)
