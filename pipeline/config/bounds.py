"""How far numbers of a configuration may go: what lies beyond is a slip of unit or of typing.

Within them all arithmetic keeps its digits and a run ends in time that one would wait for.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

LIGHTEST, DENSEST = 10.0, 30_000.0
"""Densities of a rock [kg m-3]: replicas of foam weigh more, no metal does."""

SMALLEST_PGA, LARGEST_PGA = 1e-6, 10.0
"""Peak accelerations [g]: the ground's own noise reaches the first, no record the second."""

SHORTEST_PULSE, LONGEST_PULSE = 0.001, 10.0
"""PGV/PGA [s]: of a cosine pulse of 160 Hz, above what strong-motion records hold, and one of a
minute."""

SHORTEST_STEP = 1e-6
"""Time step [s]: with a shorter one ten seconds of shaking are more than ten million steps, and the
boundary has long stopped changing."""

MOST_SCENES = 10_000
"""Directions times frictions of a study, each a scene to prepare: a direction for every tenth of a
degree at two frictions."""

Density = Annotated[float, Field(ge=LIGHTEST, le=DENSEST)]

Coordinate = Annotated[float, Field(ge=-1e8, le=1e8)]
"""Along an axis of a scan [m]; easting and northing of maps reach 1e7."""

Length = Annotated[float, Field(ge=0, le=1000)]
"""A length [m] at the scale of a rock and its hillside."""

Corner = Annotated[float, Field(ge=1e-4, le=1000)]
"""Corner frequency of a filter [Hz]: from a period of three hours to beyond any record."""

Mass = Annotated[float, Field(ge=1e-3, le=1e9)]
"""A mass [kg]: of a pebble to that of the largest shake table with its building."""

Force = Annotated[float, Field(ge=1e-3, le=1e12)]
"""A force [N] of a table's actuators."""

LARGEST_GAIN = 1e15
"""Of a servo, in its units: that of the largest mass at the highest rate."""

Gain = Annotated[float, Field(ge=0, le=LARGEST_GAIN)]

Rate = Annotated[float, Field(ge=1e-3, le=1e6)]
"""Rate of a digital control loop [Hz]."""

Travel = Annotated[float, Field(ge=1e-6, le=1000)]
"""Velocity or length [m/s, m] of what a table's drive does."""
