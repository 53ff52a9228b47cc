"""Where a rock comes to rest that falls onto a terrain."""

from __future__ import annotations

import numpy as np

from vsr_core.engines import load
from vsr_core.errors import InvalidInput
from vsr_core.rock.body import Rock
from vsr_core.run.displacement import at_rest
from vsr_core.run.overturning import COMPILED
from vsr_core.run.time_step import step_unit
from vsr_core.scan.placing import MARGIN_SHARE, clearance
from vsr_core.scene import Contact, Scene, State
from vsr_core.terrain.surface import Terrain

CONTACT = Contact(friction=1.0)
"""Contact while it falls, whatever that of the site: it neither bounces nor slides far."""


def dropped(rock: Rock, terrain: Terrain, x: float, y: float) -> State:
    """The rest of a rock that is let go just above the ground.

    Parameters
    ----------
    rock : Rock, as it is turned when it is let go
    x, y : float [m], where its centre of mass is then

    Raises
    ------
    InvalidInput
        If it does not come to rest on the terrain.
    """
    above = np.array([x, y, terrain.vertices[:, 2].max() + 2.0 * rock.radius])
    above[2] += MARGIN_SHARE * rock.radius - clearance(terrain, rock.vertices + above)
    start = State(above, np.eye(3), np.zeros(3), np.zeros(3))
    scene = Scene(rock, CONTACT, 0.0, "terrain", start=start, terrain=terrain)
    try:
        return at_rest(scene, load(COMPILED).LADDER.longest * step_unit(rock), COMPILED)
    except InvalidInput as error:
        raise InvalidInput(
            "a rock that finds no rest where it falls",
            "it comes to rest on the terrain",
            "choose another rock.pose",
        ) from error
