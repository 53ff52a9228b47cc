"""Made-up recorded motions, and writers of the formats in which instruments' files come.

`python tests/support/record_files.py data/raw/records` writes the samples of the study `records`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import netCDF4
import numpy as np
from numpy.typing import NDArray

from vsr_core import GRAVITY

Array = NDArray[np.float64]


def shaking(seed: int, rate: float, length: float, noise_hz: float, period: float) -> Array:
    """Acceleration [m/s^2]: a swell of noise around ``noise_hz``, and a pulse of ``period`` [s].

    The pulse is a cosine under a Gaussian, whose velocity and displacement end at zero.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(round(rate * length)) / rate
    spectrum = np.fft.rfft(rng.standard_normal(t.size))
    frequency = np.fft.rfftfreq(t.size, 1.0 / rate)
    spectrum *= np.exp(-0.5 * (np.log(np.maximum(frequency, 1e-3) / noise_hz) / 0.6) ** 2)
    noise = np.fft.irfft(spectrum, t.size)
    swell = (t / 0.25 / length) ** 2 * np.exp(2.0 - 2.0 * t / (0.25 * length))
    s = (t - 0.3 * length) / period
    pulse = np.cos(2.0 * np.pi * s) * np.exp(-0.5 * (s / 0.6) ** 2)
    values = 1.2 * swell * noise / np.abs(noise).max() + pulse
    return np.round(0.25 * GRAVITY * values / np.abs(values).max(), 7)


def at2(values: Array, interval: float, *, named: bool = True, number: int | None = None) -> str:
    """A PEER NGA file of an acceleration [m/s^2]."""
    count = len(values) if number is None else number
    sizes = (
        f"NPTS={count:7d}, DT=  {f'{interval:.4f}'[1:]} SEC,"
        if named
        else f"{count:5d}    {interval:.4f}    NPTS, DT"
    )
    lines = [
        "PEER NGA STRONG MOTION DATABASE RECORD",
        "Made up, 11/21/2026, Nowhere Creek, 090",
        "ACCELERATION TIME SERIES IN UNITS OF G",
        sizes,
    ]
    words = [f"{value: .7E}" for value in values / GRAVITY]
    lines += ["  ".join(words[i : i + 5]) for i in range(0, len(words), 5)]
    return "\n".join(lines) + "\n"


def cosmos(*channels: tuple[Array, int], interval: float, parameter: int = 1) -> str:
    """A COSMOS V2 file of accelerations [m/s^2] with the azimuths of their sensors."""
    return "".join(_cosmos(values, azimuth, interval, parameter) for values, azimuth in channels)


def _cosmos(values: Array, azimuth: int, interval: float, parameter: int) -> str:
    integers = np.full(100, -999)
    integers[:3], integers[53] = (2, parameter, 4), azimuth
    reals = np.full(100, -999.0)
    reals[61], reals[62] = 1e3 * interval, interval * len(values)
    called = {1: "acceleration", 2: "velocity"}[parameter]
    lines = [f"Corrected {called}    (Format v01.20 with 13 text lines)"]
    lines += [f"Made up, line {number}" for number in range(2, 14)]
    lines[4] = "Station No. 1  Nowhere Creek"
    lines.append(" 100 Integer-header values follow on 10 lines, Format=(10I8)")
    lines += _rows(integers, 10, "{:8d}")
    lines.append(" 100 Real-header values follow on 17 lines, Format=(6F13.6)")
    lines += _rows(reals, 6, "{:13.6f}")
    lines += ["   1 Comment line(s) follow, each starting with a '|':", "| made up"]
    lines.append(
        f"{len(values):8d} {called} pts, approx {interval * len(values):3.0f} secs, "
        "units=cm/sec2 (04), Format=(8F10.4)"
    )
    lines += _rows(100.0 * values, 8, "{:10.4f}")
    lines.append(f"End-of-data for chan 1 {called}")
    return "\n".join(lines) + "\n"


def _rows(numbers: Array, each: int, form: str) -> list[str]:
    words = [form.format(number) for number in numbers.tolist()]
    return ["".join(words[i : i + each]) for i in range(0, len(words), each)]


def csv(values: Array, interval: float, heading: str = "acceleration [m/s2]") -> str:
    """A table of times [s] and an acceleration in the unit of its heading."""
    rows = (f"{i * interval:.6g},{value:.7g}" for i, value in enumerate(values.tolist()))
    return "\n".join([f"time [s],{heading}", *rows]) + "\n"


def netcdf(path: Path, values: Array, interval: float, units: str = "m s-2") -> None:
    """A NetCDF file of an acceleration."""
    with netCDF4.Dataset(path, "w") as data:
        data.title, data.station = "Made up", "Nowhere Creek"
        data.createDimension("time", len(values))
        time = data.createVariable("time", "f8", ("time",), zlib=True)
        time.units, time[:] = "s", interval * np.arange(len(values))
        acceleration = data.createVariable("acceleration", "f4", ("time",), zlib=True)
        acceleration.units, acceleration[:] = units, values


def knet(values: Array, interval: float, direction: str = "N-S") -> str:
    """A K-NET file of an acceleration [m/s^2], as counts around an offset."""
    counts = np.round(values / 0.01 * 8223790.0 / 3920.0).astype(int) + 20000
    lines = [
        "Origin Time       2026/11/21 12:00:00",
        "Lat.              36.000",
        "Long.             140.000",
        "Depth. (km)       10",
        "Mag.              5.0",
        "Station Code      NWC001",
        "Station Lat.      36.1000",
        "Station Long.     140.1000",
        "Station Height(m) 10",
        "Record Time       2026/11/21 12:00:15",
        f"Sampling Freq(Hz) {round(1.0 / interval)}Hz",
        f"Duration Time(s)  {round(interval * len(values))}",
        f"Dir.              {direction}",
        "Scale Factor      3920(gal)/8223790",
        f"Max. Acc. (gal)   {100.0 * np.abs(values).max():.3f}",
        "Last Correction   2026/11/21 12:00:00",
        "Memo.",
    ]
    words = [f"{count:8d}" for count in counts.tolist()]
    lines += [" ".join(words[i : i + 8]) for i in range(0, len(words), 8)]
    return "\n".join(lines) + "\n"


def write_samples(folder: Path) -> None:
    """One record in each of the formats that are read here, from short to long pulses."""
    folder.mkdir(parents=True, exist_ok=True)
    quick, soft, near, long = (
        shaking(1, 100.0, 10.0, 6.0, 0.3),
        shaking(2, 100.0, 12.0, 2.5, 0.8),
        shaking(3, 100.0, 14.0, 2.0, 1.6),
        shaking(4, 100.0, 16.0, 1.2, 2.6),
    )
    (folder / "quick.csv").write_text(csv(quick, 0.01))
    (folder / "soft.AT2").write_text(at2(soft, 0.01))
    (folder / "near.v2").write_text(cosmos((near, 90), interval=0.01))
    netcdf(folder / "long.nc", long, 0.01)


if __name__ == "__main__":
    write_samples(Path(sys.argv[1]))
