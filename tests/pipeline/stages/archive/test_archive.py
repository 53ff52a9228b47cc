"""Archives from a table to their products: answers, directions, and rows that are wrong."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm

from pipeline import ROOT
from pipeline.cli import REFUSED, UNRESOLVED, main
from pipeline.config.problems import InputError
from pipeline.stages.archive import archive as products
from pipeline.stages.archive import archive_figures, archived_rock, rock_list, shipped_equations
from pipeline.stages.hazard.rock_fragility import of_photograph
from vsr_core.archive.photographs import ASSUMED, Answers, answers
from vsr_core.run.rocking_block import Block, first_overturning_pga

HEADER = (
    "name,alpha_1_deg,alpha_2_deg,r_1_m,r_2_m,height_m,azimuth_deg,friction,age_mean_a,age_sd_a"
)
SAMPLE = ROOT / "data/raw/archive/rocks.csv"
RATIOS = np.array(products.PGV_PGA)


def written(folder: Path, *rows: str, header: str = HEADER) -> Path:
    path = folder / "rocks.csv"
    path.write_text("\n".join((header, *rows)) + "\n", encoding="utf-8")
    return path


def answered(folder: Path, *rows: str, header: str = HEADER) -> Answers:
    archive = rock_list.read(written(folder, *rows, header=header))
    assert archive.problems == []
    return answers(archive.seen, shipped_equations.load().equations, RATIOS)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    derived = tmp_path_factory.mktemp("derived")
    assert main(["archive", str(SAMPLE), "--derived", str(derived)]) == 0
    return derived / "archives" / "rocks"


def test_each_rock_has_a_row_for_each_direction_and_level(made: Path) -> None:
    with (made / "archive.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "name", "direction_deg", "pgv_pga_s", "boundary_pga_g", "low_g", "high_g",
    ]  # fmt: skip
    ridge = [row for row in rows if row["name"] == "Ridge 7"]
    assert {float(row["direction_deg"]) for row in ridge} == {40.0, 220.0}
    assert len(rows) == 8 * 2 * len(RATIOS)
    known = [row for row in rows if row["high_g"] != "nan"]
    assert len(known) > 80
    for row in known:
        assert float(row["low_g"]) < float(row["boundary_pga_g"]) < float(row["high_g"])


def test_a_dataset_holds_the_same_with_the_spread_by_what_is_assumed(made: Path) -> None:
    data = xr.load_dataset(made / "archive.nc")
    assert data.attrs["Conventions"] == "CF-1.11"
    assert data["assumption"].values.tolist() == list(ASSUMED)
    both = np.hypot(
        data["unseen_log_sd"].pipe(lambda sd: np.sqrt((sd**2).sum("assumption"))),
        data["equation_error"] / 1.96,
    )
    np.testing.assert_allclose(both, data["fragility_log_sd"], rtol=1e-4)
    assert "interval" not in data["first_overturning_pga"].attrs["long_name"]
    given = data.sel(rock=data["rock_name"] == "Saddle 2", assumption="friction")
    assert (given["unseen_log_sd"] == 0.0).all()  # its friction is in the table


def test_each_rock_is_drawn_with_its_own_directions(made: Path) -> None:
    data = xr.load_dataset(made / "archive.nc")
    names = data["rock_name"].values.tolist()
    figure = archive_figures.boundaries(data, names)
    assert len(figure.axes) == 6
    for axes in figure.axes:
        towards = data["push_direction"].values[names.index(axes.get_title())]
        legend = axes.get_legend()
        assert legend is not None
        assert [one.get_text() for one in legend.get_texts()] == [
            f"pushed to {one:.0f}°" for one in towards
        ]


def test_the_page_says_what_was_assumed_beside_the_numbers(made: Path) -> None:
    page = (made / "archive.html").read_text(encoding="utf-8")
    for one in ASSUMED.values():
        assert one.what.replace("'", "&#39;") in page
    assert "Saddle 5" in page
    assert "open" in page  # Cliff 4: with the friction assumed it may slide


def test_sides_that_change_places_change_directions_only(tmp_path: Path) -> None:
    one = answered(tmp_path, "A,12,17,0.84,0.86,1.7,40,0.7,,")
    other = answered(tmp_path, "A,17,12,0.86,0.84,1.7,220,0.7,,")
    for name in ("boundary", "low", "high"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name)[:, ::-1], rtol=1e-12)
    assert not np.allclose(one.boundary[:, 0], one.boundary[:, 1], equal_nan=True)
    archive = rock_list.read(written(tmp_path, "A,12,17,0.84,0.86,1.7,350,0.7,,"))
    assert products.directions(archive).tolist() == [[350.0, 170.0]]


def test_what_is_given_is_no_part_of_the_band(tmp_path: Path) -> None:
    header = HEADER + ",roundness"
    vague, sure = (
        answered(tmp_path, row, header=header)
        for row in ("A,12,,,,1.7,,,,,", "A,12,12,0.8516,0.8516,1.7,,0.6,,,0.05")
    )  # the second gives what is assumed of the first: 0.49 x 1.7 / cos 12 deg is 0.8516
    np.testing.assert_allclose(vague.boundary, sure.boundary, rtol=1e-3)
    assert (vague.log_sd > sure.log_sd).all()
    assert [name for name, sd in sure.unseen.items() if sd.any()] == ["inertia"]


def test_a_rock_whose_friction_is_below_tan_alpha_slides(tmp_path: Path) -> None:
    found = answered(tmp_path, "A,20,20,0.8,0.8,1.7,,0.3,,", "B,20,20,0.8,0.8,1.7,,0.5,,")
    assert found.slides.tolist() == [True, False]
    assert np.isnan(found.boundary[0]).all()
    assert np.isfinite(found.boundary[1]).any()
    assert (found.low[0] >= math.tan(math.radians(20.0)) - 1e-12).all()


WRONG = {
    "B,abc,17,0.84,0.86,,,,,": "alpha_1_deg",
    "B,,17,0.84,0.86,,,,,": "alpha_1_deg",
    "B,12,nan,0.84,0.86,,,,,": "alpha_2_deg",
    "B,12,17,-0.84,0.86,,,,,": "r_1_m",
    "B,12,17,,,,,,,": "r_1_m",
    "B,12,17,42,43,,,,,": "r_1_m",
    "B,12,,0.5,3,,,,,": "alpha_2_deg",
    "B,12,17,0.84,1.86,,,,,": "r_2_m",
    "B,12,17,0.84,0.86,0.7,,,,": "height_m",
    "B,12,17,0.84,0.86,49,,,,": "height_m",
    "B,12,17,0.84,0.86,,,,,2500": "age_mean_a",
    "B,36,40,0.84,0.88,,,,,": "alpha_1_deg",
    "B,12,17,0.84,0.86,,700,,,": "azimuth_deg",
    "B,12,17,0.84,0.86,,,0,,": "friction",
    "B,12,17,0.84,0.86,,,,0,": "age_mean_a",
    "B,12,17,0.84": "r_2_m",
    "A,12,17,0.84,0.86,,,,,": "name",
    ",12,17,0.84,0.86,,,,,": "name",
    "B,1_2.5,17,0.84,0.86,,,,,": "alpha_1_deg",
    "B,12,17,0.84,0.86,,,,14_000,": "age_mean_a",
    '"D\nB",12,17,0.84,0.86,,,,,': "name",
    '"B,12,17,0.84,0.86,,,,,': "got quotes that do not close",
}


@pytest.mark.parametrize("row", WRONG)
def test_a_row_that_is_wrong_is_named_and_the_others_go_on(
    row: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, "A,12,17,0.84,0.86,,,,,", row, "C,12,17,0.84,0.86,,,,,")
    assert main(["archive", str(path), "--derived", str(tmp_path / "d")]) == UNRESOLVED
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("vsr: ")]
    assert len(said) == 1
    assert f"line 3: {WRONG[row]}" in said[0]
    table = (tmp_path / "d/archives/rocks/archive.csv").read_text(encoding="utf-8")
    assert {line.split(",")[0] for line in table.splitlines()[1:]} == {"A", "C"}
    page = (tmp_path / "d/archives/rocks/archive.html").read_text(encoding="utf-8")
    assert "line 3" in page


def test_an_archive_whose_name_is_no_folders_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, "A,12,17,0.84,0.86,,,,,").rename(tmp_path / "...csv")
    assert main(["archive", str(path), "--derived", str(tmp_path / "d")]) == REFUSED
    assert "a name of points" in capsys.readouterr().err
    assert not (tmp_path / "d").exists()


@pytest.mark.slow
def test_of_ten_thousand_rows_the_broken_ones_are_named(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    broken = set(random.choice(10_000, 50, replace=False).tolist())
    alphas, height = random.uniform(5.0, 30.0, (10_000, 2)), random.uniform(0.2, 2.0, 10_000)
    rows = [
        f"R{n},{a:.2f},{b:.2f},{'x' if n in broken else ''},,{h:.2f},,,,"
        for n, ((a, b), h) in enumerate(zip(alphas, height, strict=True))
    ]
    archive = rock_list.read(written(tmp_path, *rows))
    assert len(archive.rocks) == 9950
    lines = [str(one).split("line ")[1].split(":")[0] for one in archive.problems]
    assert lines == [str(n + 2) for n in sorted(broken)]
    found = answers(archive.seen, shipped_equations.load().equations, RATIOS)
    assert found.boundary.shape == (9950, 2, len(RATIOS))
    # Long pulses: every rock has a boundary, not far above g tan(alpha).
    assert (found.boundary[..., -1] / found.static[:, None] < 2.0).all()


@pytest.mark.parametrize(
    ("header", "row", "said"),
    [
        (HEADER.replace("r_1_m", "r_1_cm"), "A,12,17,84,86,,,,,", "did you mean r_1_m?"),
        (HEADER.replace("alpha_1_deg", "roundness"), "A,0.1,17,1,1,,,,,", "alpha_1_deg"),
        (HEADER.replace("r_2_m", "r_1_m"), "A,12,17,1,1,,,,,", "a column twice"),
        (HEADER, "", "no row"),
        (HEADER.replace(",", ";"), "A;12;17;1;1;;;;;", "semicolons; commas part columns"),
    ],
)
def test_a_table_of_something_else_is_refused(
    header: str, row: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, row, header=header)
    assert main(["archive", str(path), "--derived", str(tmp_path / "d")]) == REFUSED
    assert said in capsys.readouterr().err
    assert not (tmp_path / "d/archives").exists()


def test_names_are_shown_as_they_are(tmp_path: Path) -> None:
    names = [
        "=cmd()",
        "\N{FULLWIDTH EQUALS SIGN}cmd()",
        "<script>alert(1)</script>",
        "$x_1^{$",
        '"a, b"',
        "A\u2028B\x0cC\x85D_1",
        "Rock \N{LATIN SMALL LETTER E WITH ACUTE}",
    ]
    path = written(tmp_path, *(f"{name},12,17,0.84,0.86,,,,," for name in names))
    assert main(["archive", str(path), "--derived", str(tmp_path / "d")]) == 0
    folder = tmp_path / "d/archives/rocks"
    with (folder / "archive.csv").open(encoding="utf-8", newline="") as file:
        shown = dict.fromkeys(row["name"] for row in csv.DictReader(file))
    assert list(shown) == ["'=cmd()", f"'{names[1]}", *names[2:4], "a, b", *names[5:]]
    assert "<script>alert" not in (folder / "archive.html").read_text(encoding="utf-8")


def test_where_every_row_is_wrong_there_is_a_page_that_says_so(tmp_path: Path) -> None:
    path = written(tmp_path, "A,x,17,0.84,0.86,,,,,")
    assert main(["archive", str(path), "--derived", str(tmp_path / "d")]) == UNRESOLVED
    page = (tmp_path / "d/archives/rocks/archive.html").read_text(encoding="utf-8")
    assert "No row of" in page
    assert "line 2" in page
    assert xr.load_dataset(tmp_path / "d/archives/rocks/archive.nc").sizes["rock"] == 0


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (("A,12,17,1,1,,,,,", "A,22,27,1,1,,,,,"), "line 3: name: got 'A', which line 2 has, too"),
        (("A,12,x,1,1,,,,,", "A,22,27,1,1,,,,,"), "line 2: alpha_2_deg: got 'x'"),
    ],
)
def test_a_rock_with_a_faulty_row_of_its_name_stands_nowhere(
    tmp_path: Path, rows: tuple[str, ...], words: str
) -> None:
    path = written(tmp_path, *rows, "B,12,17,1,1,,,,,")
    with pytest.raises(InputError, match=words):
        archived_rock.answered(path, "A")
    assert archived_rock.answered(path, "B").static > 0.0


def test_draws_of_a_rock_are_its_fragility(tmp_path: Path) -> None:
    """What is not known of a rock is the same in all rows, and its draws spread as the band."""
    path = written(tmp_path, "A,12,17,0.84,0.86,,40,,,")
    rock = archived_rock.answered(path, "A")
    assert rock.directions.tolist() == [40.0, 220.0]
    draws = np.log(rock.draws)
    all_tip = rock.none == 0.0
    assert all_tip.mean() > 0.5
    np.testing.assert_allclose(
        draws.mean(axis=0)[all_tip], np.log(rock.median)[all_tip], atol=1e-12
    )
    np.testing.assert_allclose(draws.std(axis=0)[all_tip], rock.log_sd[all_tip], rtol=0.03)
    fragility = of_photograph(rock)
    levels = 9.81 * np.geomspace(0.1, 3.0, 50)
    by_draws = np.mean([one(levels) for one in fragility.others], axis=0)
    assert np.abs(by_draws - fragility.mean(levels)).max() < 0.02


@pytest.mark.slow
def test_the_band_holds_housners_boundary_of_blocks_that_short_pulses_hardly_topple(
    tmp_path: Path,
) -> None:
    """Where the equations give 2.5 g tan(alpha) and more, another impact may leave none near it."""
    blocks = [Block(0.65, 2.1), Block(0.3, 1.4), Block(0.25, 0.8), Block(0.2, 0.9)]
    alpha = [math.degrees(one.alpha) for one in blocks]
    rows = [
        f"B{n},{a},{a},{one.radius},{one.radius},,,1.5,,,0"
        for n, (a, one) in enumerate(zip(alpha, blocks, strict=True))
    ]
    found = answered(tmp_path, *rows, header=f"{HEADER},roundness")
    steep = np.argwhere(found.boundary[:, 0] > 2.5 * found.static[:, None])
    assert len(steep) == 3
    for n, k in steep.tolist():
        block, low, high = blocks[n], found.low[n, 0, k], found.high[n, 0, k]
        uplift = block.uplift
        by_housner = first_overturning_pga(block, RATIOS[k], 10.0 * uplift, 0.05 * uplift)
        pga = min(by_housner / block.gravity, 10.0 * found.static[n])
        assert low < pga
        assert pga < high or np.isnan(high)
    assert found.none[0, 0, list(RATIOS).index(0.14)] > 0.05


def test_draws_without_a_boundary_stand_up_to_where_one_was_looked_for(tmp_path: Path) -> None:
    path = written(tmp_path, "A,15,15,1.1,1.1,,40,1.5,,")
    rock = archived_rock.answered(path, "A")
    row = int(rock.none[0].argmax())
    share = rock.none[0, row]
    assert share > 0.05
    draws = rock.draws[:, 0, row]
    assert (draws == rock.farthest).mean() == pytest.approx(share, abs=0.5 / archived_rock.DRAWS)
    tips = np.log(draws[draws != rock.farthest])
    assert np.median(tips) == pytest.approx(np.log(rock.median[0, row]), abs=0.02)
    fragility, levels = of_photograph(rock), 9.81 * np.geomspace(0.1, 5.0, 50)
    by_draws = np.mean([one(levels) for one in fragility.others], axis=0)
    assert np.abs(by_draws - fragility.mean(levels)).max() < 0.02
    assert (fragility.mean(9.81 * np.array([20.0])) > 0.99).all()


def test_draws_with_a_friction_below_tan_alpha_stand_in_any_shaking(tmp_path: Path) -> None:
    """Of a friction that is assumed, that share of the rocks; of one that is given none."""
    path = written(tmp_path, "A,28,28,0.84,0.84,,40,,,", "B,28,28,0.84,0.84,,40,0.6,,")
    vague, sure = (archived_rock.answered(path, name) for name in "AB")
    assumed = ASSUMED["friction"]
    share = norm.cdf(math.tan(math.radians(28.0)), assumed.value, assumed.sd)
    stands = np.isposinf(vague.draws).all(axis=(1, 2))
    assert stands.mean() == pytest.approx(share, abs=0.5 / archived_rock.DRAWS)
    tips = vague.draws[~stands]
    assert np.isfinite(tips).all()
    middle, all_tip = np.log(tips).mean(axis=0), vague.none == 0.0
    assert all_tip.mean() > 0.5
    np.testing.assert_allclose(middle[all_tip], np.log(vague.median)[all_tip], atol=1e-12)
    assert np.isfinite(sure.draws).all()
    fragility, levels = of_photograph(vague), 9.81 * np.geomspace(0.1, 1e6, 50)
    for mean, others in (
        (fragility.mean, fragility.others),
        (fragility.by_yaw[40.0], fragility.others_by_yaw[40.0]),
    ):
        by_draws = np.mean([one(levels) for one in others], axis=0)
        assert np.abs(by_draws - mean(levels)).max() < 0.02
        np.testing.assert_allclose(mean(levels)[:, -1], 1.0 - share, rtol=1e-9)


def test_another_file_of_the_same_name_has_a_folder_of_its_own(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        path = written(tmp_path / name, "A,12,17,0.84,0.86,,,,,")
        assert main(["archive", str(path), "--derived", str(tmp_path / "d")]) == 0
    assert len(list((tmp_path / "d/archives").iterdir())) == 2


def test_equations_are_made_anew_from_runs(tmp_path: Path) -> None:
    given = ["archive-equations", "--shapes", "5", "--workers", "0", "--derived", str(tmp_path)]
    assert main(given) == REFUSED  # of too few shapes nothing can be fitted


def test_columns_in_another_unit_are_told(tmp_path: Path) -> None:
    """Radians and thousands of years, which have no part in the boundaries."""
    path, head = tmp_path / "rocks.csv", "name,alpha_1_deg,r_1_m,azimuth_deg,age_mean_a\n"
    path.write_text(f"{head}a,20,0.5,40,14000\nb,20,0.5,,2000\n")
    assert list(rock_list.read(path).doubts) == []
    path.write_text(f"{head}a,20,0.5,0.698,14\nb,20,0.5,,2\n")
    assert list(rock_list.read(path).doubts) == [
        "azimuth_deg from 0.698 to 0.698: radians?",
        "age_mean_a from 2 to 14 years: thousands of years?",
    ]
    path.write_text(f"{head}a,20,0.5,40,1400011\nb,20,0.5,,2000\n")
    assert list(rock_list.read(path).doubts) == [
        "age_mean_a to 1,400,011 years: two ages in one field?"
    ]


def test_an_age_exchanged_with_its_error_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rocks.csv"
    path.write_text("name,alpha_1_deg,r_1_m,age_mean_a,age_sd_a\na,20,0.5,2500,14000\n")
    (problem,) = rock_list.read(path).problems
    assert "age_sd_a" in str(problem)
    assert "exchange mean and sd" in str(problem)


def test_a_table_that_is_cut_inside_its_last_number_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rocks.csv"
    path.write_text("name,alpha_1_deg,height_m\nA,15,1.55\nB,20,2.25")
    assert len(rock_list.read(path).rocks) == 2
    for end in ("2.2", "2.", "2"):
        path.write_text(f"name,alpha_1_deg,height_m\nA,15,1.55\nB,20,{end}")
        with pytest.raises(InputError, match="a last line that ends in"):
            rock_list.read(path)


def test_a_single_row_ends_its_line(tmp_path: Path) -> None:
    """Its last number has the digits of another field: 25 of 2500 years."""
    path = tmp_path / "rocks.csv"
    path.write_text(f"{HEADER}\nA,12,17,0.84,0.86,,40,,14000,25")
    with pytest.raises(InputError, match="a last line that ends in '25'"):
        rock_list.read(path)


def test_a_table_that_is_cut_after_a_comma_is_refused(tmp_path: Path) -> None:
    """Also where another row ends in an empty field, as this one would then."""
    whole = f"{HEADER}\nA,12,17,0.84,0.86,,40,,,\nB,12,17,0.84,0.86,,200,0.6,,1500"
    path = tmp_path / "rocks.csv"
    path.write_text(f"{whole}\n")
    said = rock_list.read(path)
    for length in range(whole.index("\nB") + 3, len(whole)):
        path.write_text(whole[:length])
        try:
            cut = rock_list.read(path)
        except InputError:
            continue
        assert cut.problems, length  # the row is named as one of too few fields
        assert cut.rocks == said.rocks[:1]


def test_a_quoted_name_with_a_number_sign_is_a_rock(tmp_path: Path) -> None:
    header = "name,alpha_1_deg,height_m"
    rows = ('"# seen by A, B"', '"# twice, by C",,', '"#2 East",15,1.5', "# no rock")
    archive = rock_list.read(written(tmp_path, *rows, header=header))
    assert [rock.name for rock in archive.rocks] == ["#2 East"]
    assert archive.problems == []


def test_a_name_that_begins_with_a_number_sign_is_no_comment(tmp_path: Path) -> None:
    rows = ("#7,12,17,0.84,0.86,,,,,", "B,12,17,0.84,0.86,,,,,")
    with pytest.raises(InputError, match=r"name: got '#7,12.*, a row or a comment"):
        rock_list.read(written(tmp_path, *rows))
