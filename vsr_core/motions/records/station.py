"""The channel of a record in the metadata of its station (StationXML)."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsr_core.errors import InvalidInput


def channel_of(trace: Any, inventory: Any) -> Any:
    """The one channel, ObsPy's, whose response and orientation hold all through a trace.

    An epoch of the channel lasts up to its end and not beyond: a record that begins there is of the
    next one.

    Raises
    ------
    InvalidInput
        If the metadata have none, one without a response, or epochs that are not alike.
    """
    stats = trace.stats
    names = ("network", "station", "location", "channel")
    found = inventory.select(**{name: stats[name] for name in names})
    every = [one for network in found for station in network for one in station]
    epochs = [one for one in every if _holds(one, stats.starttime, stats.endtime)]
    span, remedy = f"{trace.id} from {stats.starttime} to {stats.endtime}", "cut it there"
    if not epochs:
        rule = "the response is that of the record's channel and time"
        raise InvalidInput(f"no channel of {span} in the response", rule, "give its response")
    if any(one.response is None or not one.response.response_stages for one in epochs):
        rule = "it is divided by, at each frequency"
        remedy = "download it at level=response"
        raise InvalidInput(f"a response without stages for {span}", rule, remedy)
    first, *others = sorted(epochs, key=lambda one: one.start_date or stats.starttime)
    for other in others:
        if not _alike(first, other):
            since = max(other.start_date or stats.starttime, stats.starttime)
            given = f"a record of {span}, another response or orientation since {since}"
            raise InvalidInput(given, "it is divided by one response", remedy)
    known = stats.starttime
    for one in (first, *others):
        if (one.start_date or known) <= known + stats.delta:
            known = max(known, one.end_date or stats.endtime)
    if known < stats.endtime:
        given = f"a record of {span}, of which the response is not known from {known} on"
        raise InvalidInput(given, "it holds all through the record", remedy)
    return first


def _holds(channel: Any, start: Any, end: Any) -> bool:
    begins = channel.start_date is None or channel.start_date <= end
    return begins and (channel.end_date is None or channel.end_date > start)


def _alike(one: Any, other: Any) -> bool:
    """Whether two channels point alike and respond alike, at frequencies from 0.01 to 40 Hz."""
    if (one.azimuth, one.dip) != (other.azimuth, other.dip):
        return False
    band = np.geomspace(0.01, 40.0, 16)
    first, second = (
        channel.response.get_evalresp_response_for_frequencies(band, "ACC")
        for channel in (one, other)
    )
    return bool(np.allclose(first, second, rtol=1e-6, atol=0.0))
