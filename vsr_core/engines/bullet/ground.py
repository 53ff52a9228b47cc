"""A terrain as Bullet needs it: only what of it a rock may touch next.

Bullet tests a hull against every triangle in its bounding box, touched or not; on a scan these are
hundreds, and each costs as much as a box on a plane. So a terrain is a set of blocks, its convex
parts or else tiles of a few triangles, and only the blocks near the rock's surface are in Bullet's
world. The cost follows what the rock touches, however large the terrain.
"""

from __future__ import annotations

import math

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.engines.bullet.binding import pybullet
from vsr_core.engines.bullet.collision_shapes import leave_to_the_rock, surroundings
from vsr_core.engines.bullet.tiles import Tiles
from vsr_core.rock.body import Rock, convex_hull
from vsr_core.scene import State
from vsr_core.terrain.surface import Terrain

NEAREST = 0.06
"""Distance, in Bullet's length unit (0.6 % of the rock's radius), within which a block comes into
the world, besides what the rock may reach before the next look."""

KEPT = 0.2
"""Way of the rock, in the same unit, after which it is seen whether a block can go again: to come
and to go cost as much as some steps."""


class GroundBlocks:
    """The blocks of a terrain around a rock, in one world.

    Parameters
    ----------
    scale : float, Bullet's length unit per metre
    client, maximal : int, Bullet's connection and kind of bodies
    """

    def __init__(
        self, terrain: Terrain, rock: Rock, scale: float, client: int, maximal: int
    ) -> None:
        self._client, self._maximal, self._scale = client, maximal, scale
        self._tiles: Tiles | None = None
        held = [part * scale for part in terrain.parts]
        if not held:
            self._tiles = Tiles(terrain, scale, round_rock=rock.shape == "sphere")
            held = self._tiles.corners()
        self._blocks, self._points = held, np.concatenate(held)
        low, high = (
            np.array([reach(points, axis=0) for points in held]) for reach in (np.min, np.max)
        )
        self._middles = 0.5 * (low + high)
        self._halves = 0.5 * np.linalg.norm(high - low, axis=1)
        self._counts = np.array([len(points) for points in held])
        self._firsts = np.cumsum(self._counts) - self._counts
        corners = surroundings(rock)
        hull = convex_hull(corners * scale)
        self._normals, self._offsets = hull.normals, hull.offsets
        self._radius = float(np.linalg.norm(corners, axis=1).max()) * scale
        self._shapes: dict[int, int] = {}
        self._bodies: dict[int, int] = {}
        self._way, self._safe = 0.0, -math.inf
        self._due = np.full(len(held), -math.inf)

    def clear(self) -> None:
        """Take all blocks away: the next run begins as the first one did."""
        for body in self._bodies.values():
            pybullet.removeBody(body, self._client)
        self._bodies.clear()
        self._way, self._safe = 0.0, -math.inf
        self._due[:] = -math.inf

    def follow(self, state: State, duration: float, acceleration: float) -> None:
        """See that all blocks are there that the rock may touch within ``duration`` [s].

        ``acceleration`` [m/s^2] bounds what can speed it up in that time without contact.
        """
        speed = float(np.linalg.norm(state.velocity)) + acceleration * duration
        speed = speed * self._scale + float(np.linalg.norm(state.angular_velocity)) * self._radius
        ahead = speed * duration
        if not math.isfinite(ahead):
            return
        if self._way + ahead > self._safe:
            self._gather(state, ahead + NEAREST)
            self._safe = self._way + ahead + NEAREST
        self._way += ahead

    def _gather(self, state: State, near: float) -> None:
        """Look again at the blocks that may have come near, and bring or take them.

        A block a distance away is not looked at again before all ways since can add up to that.
        """
        due = np.flatnonzero(self._due <= self._way + near)
        if not len(due):
            return
        centre = state.position * self._scale
        off = self._middles[due] - centre
        gaps = np.sqrt((off * off).sum(axis=1)) - self._halves[due] - self._radius
        close = gaps <= near
        gaps[close] = self._apart(due[close], centre, state)
        self._due[due] = self._way + gaps
        for block, gap in zip(due.tolist(), gaps.tolist(), strict=True):
            if gap <= near:
                if block not in self._bodies:
                    self._bodies[block] = self._body(block)
                self._due[block] = self._way + near + KEPT
            elif block in self._bodies:
                pybullet.removeBody(self._bodies.pop(block), self._client)

    def _apart(self, blocks: Indices, centre: Array, state: State) -> Array:
        """Lower bounds of the distance of blocks from the rock."""
        if not len(blocks):
            return np.empty(0)
        counts = self._counts[blocks]
        begin = np.cumsum(counts) - counts
        own = np.arange(counts.sum()) + np.repeat(self._firsts[blocks] - begin, counts)
        points = (self._points[own] - centre) @ state.rotation
        # A plane of the hull that has all of a block before it keeps them that far apart.
        ahead = np.minimum.reduceat(self._normals @ points.T, begin, axis=1)
        return np.asarray((ahead - self._offsets[:, None]).max(axis=0))

    def _body(self, block: int) -> int:
        body = pybullet.createMultiBody(
            0.0,
            self._shape(block),
            -1,
            useMaximalCoordinates=self._maximal,
            physicsClientId=self._client,
        )
        leave_to_the_rock(body, -1, self._client)
        return int(body)

    def _shape(self, number: int) -> int:
        if number not in self._shapes:
            if self._tiles:
                shape = self._tiles.shape(number, self._client)
            else:
                shape = pybullet.createCollisionShape(
                    pybullet.GEOM_MESH,
                    vertices=self._blocks[number].tolist(),
                    physicsClientId=self._client,
                )
            self._shapes[number] = int(shape)
        return self._shapes[number]
