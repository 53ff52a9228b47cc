"""What a figure on terrain must say of it: whose it is."""

from __future__ import annotations

import xarray as xr


def source(rock: xr.Dataset) -> str:
    """Where rock and terrain come from, for the corner of a figure."""
    if rock.attrs["surrogate"]:
        return "SURROGATE rock and terrain, made up: no statement about the real site"
    return str(rock.attrs["shape_source"])
