"""Surrogates: stand-ins for scans that are not public, generated from figures and rules.

No point of a scan is in them. What is computed with one is no statement about a real rock or
its site.
"""

from __future__ import annotations

from vsr_core.surrogates import double_rock, double_rock_terrain, granite_dells, sine_hills

GENERATORS = {"double_rock": double_rock.double_rock}
"""Closed rocks by name: functions to vertices [m] and faces."""

SITES = {"double_rock_terrain": double_rock_terrain.site, "granite_dells": granite_dells.site}
"""Rocks on their terrain by name: functions to a ``SurrogateSite``; ``scan.scan`` surveys one."""

GROUNDS = {"sine_hills": sine_hills.ground}
"""Grounds for rocks in files of their own, by name: functions to vertices [m] and faces."""
