"""Where components point: by the header of SAC, by StationXML, else by their names."""

from __future__ import annotations

import io

import numpy as np
import pytest
from support import record_files as files

from vsr_core.errors import InvalidInput
from vsr_core.motions.records.components import check_together
from vsr_core.motions.records.directions import doubts
from vsr_core.motions.records.formats import Reading, read, read_all
from vsr_core.motions.records.record import Record

obspy = pytest.importorskip("obspy")

PLAIN = Reading(unit="m/s2")
CORNERS = 0.05, 0.1, 25.0, 35.0
STEP = 0.01


def wave(place: int) -> files.Array:
    return files.shaking(place, 50.0, 3.0, 5.0, 0.5)


def sac(place: int, channel: str, **header: float) -> Record:
    head = {"channel": channel, "station": "NWC", "delta": STEP, "sac": header}
    file = io.BytesIO()
    obspy.Trace(wave(place).astype("f4"), head).write(file, format="SAC")
    return read(file.getvalue(), ".sac", PLAIN)


def by_response(**told: tuple[float, float]) -> Record:
    """Channels of one file, their azimuths and dips in the response."""
    from obspy.core.inventory import Channel, Inventory, Network, Response, Station

    flat = Response.from_paz([], [], 1e6, input_units="M/S**2", output_units="COUNTS")
    channels = [
        Channel(name, "", 0.0, 0.0, 0.0, 0.0, *known, sample_rate=1 / STEP, response=flat)
        for name, known in told.items()
    ]
    station = Station("NWC", 0.0, 0.0, 0.0, channels=channels)
    xml, waves = io.BytesIO(), io.BytesIO()
    Inventory([Network("XX", [station])]).write(xml, format="STATIONXML")
    obspy.Stream(
        obspy.Trace(
            np.round(1e6 * wave(place)).astype("i4"),
            {"network": "XX", "station": "NWC", "channel": name, "delta": STEP},
        )
        for place, name in enumerate(told)
    ).write(waves, format="MSEED")
    return read_all(waves.getvalue(), ".mseed", Reading(response=xml.getvalue(), corners=CORNERS))


def refusal(**components: Record) -> str:
    with pytest.raises(InvalidInput) as error:
        check_together(components)
    return f"{error.value.given}; {error.value.rule}; {error.value.remedy}"


def test_of_channels_1_and_2_the_header_of_sac_tells_the_side() -> None:
    one = sac(1, "HN1", cmpaz=10.0, cmpinc=90.0)
    two = sac(2, "HN2", cmpaz=100.0, cmpinc=90.0)
    check_together({"x": two, "y": one})
    said = refusal(x=one, y=two)
    assert said == (
        "HN1 (10 deg) as x and HN2 (100 deg) as y; y points 90 degrees to the left of x; "
        "exchange x and y"
    )
    down = sac(3, "HNZ", cmpaz=0.0, cmpinc=180.0)
    assert "HNZ as z, which points down" in refusal(x=two, y=one, z=down)
    check_together({"x": two, "y": one, "z": sac(3, "HNZ", cmpaz=0.0, cmpinc=0.0)})


def at2(channel: str, place: int = 1) -> Record:
    lines = files.at2(wave(place), STEP).splitlines(keepends=True)
    lines[1] = f"CHI-CHI 09/20/99, CHY006, {channel}\n"
    return read("".join(lines).encode(), ".at2", Reading())


PEER = """
V | V (CWB) | V1 | ABBAR--V | U | UP | -UP | U-D | VRT | VERT1 | DWN | UPDO | G02-UP | U/D
"""


@pytest.mark.parametrize("name", [name.strip() for name in PEER.split("|")])
def test_vertical_components_of_peer_are_not_horizontal(name: str) -> None:
    assert "which is vertical" in refusal(x=at2(name))
    assert "which is vertical" in refusal(x=at2("000"), y=at2(name, 2))


def test_a_line_of_peer_may_end_in_a_comma() -> None:
    assert "which is vertical" in refusal(x=at2("UP,"))
    assert at2("").station == "CHY006"
    check_together({"x": at2("")})


def column(name: str, place: int = 1) -> Record:
    return Record(wave(place), STEP, (name,), "", "", "g")


LEVEL = """
u | v | V | GBZ_180 | acc_x | vel | acc_ver2 | acc (g) | HN1 | 90 (2) | E.1 | acc.x.g |
XX.STA..HNE | A.090 | ax_0.250
""".replace("\n", "")

DOUBTFUL = """
up-stream | x (up) | GNZ_180 | GLZ 000 | THZ_E | MLZ 90 | GNZ 000 | Down hole 090 | DN_090 |
VER 090 | x (z up) | East (Z down) | HNZ 10 | UP 090 | vert. array 1 east | az 1 | a (Z) |
az_raw | az_mps2 | Az corrected | AZ_SENSOR3 | z.filt | acc_z_raw | UD raw | H1 (Az 90) | Az 45 |
H1 Az N60E | 45 deg az | H1 090 Az | 090 AZ | 12 az | vert acc | z_001 | UD 002 | HNZ_001 |
DWN 002 | acc_down 001 | UD.1 | acc.z.g | UD.gal | HNZ.00 | az.1 | az_ms2 | acc (U-D) | U-D acc |
az_01 | 01_az | AZ090 | DN090 | UP090 | HNZ001 | acc_z101
"""

VERTICAL = """
z [m/s2] | acc_z | acceleration_UD | up (1) | accz | acc_up | acc up | a_down | az10 | accz12 |
Up-Down | UP/DOWN | up_down (g) | accelerationZ | hnz | az | az1 | zacc | UpDn | Up m/s^2 |
THZ_Z | acc_up m/s2 | CH1_UP | CH1 Z | CH2 vertical | V2 UP | COMP UP | Channel 3 vertical |
G02-UP | station 090 up | a_z | acc U-D | ACC_U-D | zaccel | XX.STA..HNZ | acc Up/Down | UD10 |
UD500 | UD2018 | Z1234 | HNZ999 | UP400 | VERT1001 |
U - D | U.D. | Up - Down | Down-Up | UP--DOWN | up&down | acc Up . Down
"""


def names_in(text: str) -> list[str]:
    return [name.strip() for name in text.split("|")]


@pytest.mark.parametrize("name", names_in(VERTICAL))
def test_a_channel_whose_last_word_is_vertical_is_not_horizontal(name: str) -> None:
    assert "which is vertical" in refusal(x=column(name))


@pytest.mark.parametrize("name", names_in(DOUBTFUL))
def test_a_vertical_word_among_others_is_told(name: str) -> None:
    """It may be a station, a hole, an array; what follows it, an axis or an azimuth."""
    check_together({"x": column(name)})
    (told,) = doubts({"x": column(name)})
    assert "is taken as horizontal" in told


@pytest.mark.parametrize("name", names_in(LEVEL))
def test_columns_u_and_v_may_be_horizontal(name: str) -> None:
    check_together({"x": column(name)})
    assert not doubts({"x": column(name)})


def test_a_name_of_thousands_of_digits_is_no_azimuth() -> None:
    check_together({"x": column("9" * 5000)})


EAST_AND_NORTH = """
E-W & N/S | EW1 & NS1 | East & North | S69E & N21E | 090 & 000 | BXE & BXN | E-W & N
"""

WITH_OTHER_WORDS = """
acc_EW & acc_NS | CH2_E & CH1_N | E-W acc & N-S acc | H2 090 & H1 000 | acc_090 (g) & acc_000 (g) |
XX.STA..HNE & XX.STA..HNN | acc.E & acc.N | e & n | hne & hnn | acc E & acc N-S | acc_EW & acc N/S |
acc North 90 deg East & acc North
"""


def pairs(text: str) -> list[tuple[str, str]]:
    return [(x, y) for x, _, y in (name.partition(" & ") for name in names_in(text))]


@pytest.mark.parametrize(("east", "north"), pairs(EAST_AND_NORTH))
def test_names_of_sides_say_where_they_point(east: str, north: str) -> None:
    check_together({"x": column(east), "y": column(north, 2)})
    assert not doubts({"x": column(east), "y": column(north, 2)})
    assert "exchange x and y" in refusal(x=column(north), y=column(east, 2))


@pytest.mark.parametrize(("east", "north"), pairs(WITH_OTHER_WORDS))
def test_a_side_among_other_words_is_told(east: str, north: str) -> None:
    assert not doubts({"x": column(east), "y": column(north, 2)})
    check_together({"x": column(north), "y": column(east, 2)})
    (told,) = doubts({"x": column(north), "y": column(east, 2)})
    assert "by these words y is not to the left of x" in told


@pytest.mark.parametrize(
    "names",
    [
        *(("ax_0.250", "ay_0.250"), ("acc.1", "acc.2"), ("run", "one"), ("S_x", "S_y")),
        *(("Chn 3", "Chn 4"), ("D_x", "D_N"), ("u", "w")),
    ],
)
def test_names_that_say_no_direction_are_taken_as_given(names: tuple[str, str]) -> None:
    for x, y in (names, names[::-1]):
        check_together({"x": column(x), "y": column(y, 2)})
        assert not doubts({"x": column(x), "y": column(y, 2)})


LEVEL_PAIR = {"x": column("E-W"), "y": column("N-S", 2)}


def test_a_vertical_that_points_down_is_refused_or_told() -> None:
    for name in names_in("down (3) | a_down | DWN (ERD) | G02-DWN"):
        assert "which points down" in refusal(**LEVEL_PAIR, z=column(name, 3))
    for name, word in (
        *(("Z (down)", "down"), ("UD (down positive)", "down"), ("HNZ (g, down)", "down")),
        *(("DOWN raw", "DOWN"), ("XX.DN..HNZ", "DN"), ("Down hole UD", "Down")),
        *(("E raw", "E"), ("N_filtered", "N"), ("acc 090", "090"), ("UP 180", "180"), ("x", "x")),
        *(("GNZ 090", "090"), ("acc_E (up)", "E"), ("w", "w")),
    ):
        check_together({**LEVEL_PAIR, "z": column(name, 3)})
        told = doubts({**LEVEL_PAIR, "z": column(name, 3)})
        assert [f"though {word} may mean another direction" in line for line in told] == [True]


UPWARD = """
Up-Down | U/D | acc_up | V | acceleration (3) | acc Up-Down | acc (Up-Down) | Up/Down acc |
Up - Down | Vertical (Up - Down) | Down-Up | Up.Down | az_0.250 | acc_z_0.125
"""


@pytest.mark.parametrize("name", names_in(UPWARD))
def test_a_vertical_may_be_named_by_both_of_its_ends(name: str) -> None:
    check_together({**LEVEL_PAIR, "z": column(name, 3)})
    assert not doubts({**LEVEL_PAIR, "z": column(name, 3)})


def test_a_sensor_among_others_in_its_direction_points_there() -> None:
    """COSMOS V2 of a structure has several channels of one direction: their names are numbered."""
    one, other = (
        Record(wave(place), STEP, (name,), "", "", "g", instruments=("NWC",))
        for place, name in enumerate(("90 (2)", "360 (1)"))
    )
    assert "exchange x and y" in refusal(x=other, y=one)
    check_together({"x": one, "y": other})


def test_a_header_that_was_not_filled_in_tells_nothing() -> None:
    empty = {"cmpaz": 0.0, "cmpinc": 0.0}
    check_together({"x": sac(1, "HNE", **empty), "y": sac(2, "HNN", **empty)})
    assert "exchange" in refusal(x=sac(1, "HNN", **empty), y=sac(2, "HNE", **empty))
    whole = by_response(HNE=(0.0, 0.0), HNN=(0.0, 0.0), HNZ=(0.0, 0.0))
    check_together(
        {axis: whole.channel(f"HN{name}") for axis, name in zip("xyz", "ENZ", strict=True)}
    )


def test_a_dip_in_the_place_of_an_inclination_is_understood() -> None:
    """As files have it whose writers took SEED's for SAC's."""
    level = {
        "x": sac(1, "HN2", cmpaz=100.0, cmpinc=0.0),
        "y": sac(2, "HN1", cmpaz=10.0, cmpinc=0.0),
    }
    check_together({**level, "z": sac(3, "HNZ", cmpaz=0.0, cmpinc=-90.0)})
    assert "exchange" in refusal(x=level["y"], y=level["x"])


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ({"x": "HN2", "y": "HN3", "z": "HN1"}, ""),
        ({"x": "HN3", "y": "HN2", "z": "HN1"}, "exchange x and y"),
        ({"x": "HN1", "y": "HN2"}, "HN1 as x, which is vertical"),
        ({"x": "HN2", "z": "HN3"}, "HN3 as z; z is the vertical component"),
    ],
)
def test_a_response_tells_where_its_channels_point(axes: dict[str, str], words: str) -> None:
    """As of the instrument BK.VALB.40, of which channel 1 is the vertical one."""
    whole = by_response(HN1=(0.0, -90.0), HN2=(336.0, 0.0), HN3=(246.0, 0.0))
    components = {axis: whole.channel(name) for axis, name in axes.items()}
    if words:
        assert words in refusal(**components)
    else:
        check_together(components)
        assert not doubts(components)


def test_names_that_are_not_where_channels_point_are_told() -> None:
    for east, north, words in ((91.0, 1.0, ""), (60.0, 330.0, "HNE as x points to 60 deg")):
        whole = by_response(HNE=(east, 0.0), HNN=(north, 0.0))
        components = {"x": whole.channel("HNE"), "y": whole.channel("HNN")}
        check_together(components)
        told = doubts(components)
        assert words in "; ".join(told)
        assert bool(told) == bool(words)
        assert words in "; ".join(doubts({"x": components["x"]}))


def test_north_of_cosmos_is_360_and_0_is_nothing() -> None:
    east = read(files.cosmos((wave(1), 90), interval=STEP).encode(), ".v2", Reading())
    text = files.cosmos((wave(2), 0), interval=STEP)
    unknown = read(text.encode(), ".v2", Reading())
    named = text.replace("| made up", "|<SCNL>BMR.BNZ.AK.--    <AUTH> 2019/02/01 21:38:15.000")
    up = read(named.encode(), ".v2", Reading())
    assert (unknown.channels, up.channels) == (("unknown",), ("BNZ",))
    check_together({"x": east, "z": up})
    assert "BNZ as y, which is vertical" in refusal(x=east, y=up)


def test_channels_of_one_letter_or_figure() -> None:
    """1 and 2 are numbers of channels, and no degrees."""
    one, two, up = (sac(n, name) for n, name in enumerate("12Z", 1))
    assert "Z as y, which is vertical" in refusal(x=sac(1, "E"), y=up)
    check_together({"x": two, "y": one, "z": up})
    check_together({"x": one, "y": two})
    assert doubts({"x": one, "y": two})
    assert not doubts({"x": two, "y": one})


@pytest.mark.parametrize("whole", [True, False])
def test_a_response_without_stages_is_told(whole: bool) -> None:
    from vsr_core.motions.records.instrument_response import without_response

    stream, inventory = obspy.read().select(channel="EHZ"), obspy.read_inventory()
    (channel,) = inventory.select(channel="EHZ", time=stream[0].stats.starttime)[0][0]
    if whole:
        channel.response.response_stages = []
    else:
        channel.response = None
    with pytest.raises(InvalidInput, match=r"a response without stages for BW\.RJOB\.\.EHZ"):
        without_response(stream, inventory, CORNERS)
