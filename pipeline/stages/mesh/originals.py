"""Meshes of rocks that others have published: where they are, and what tells them from others."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Original:
    """A published mesh.

    Attributes
    ----------
    height : float [m], of the rock that is wanted where the file holds another size; None for a
        file in metres
    tests : bool, whether it is the specimen of shake-table tests, whose table and assumptions are
        shipped under ``configs/tests/``
    """

    url: str
    sha256: str
    height: float | None
    credit: str
    tests: bool = False


_DOUBLE_ROCK = (
    "https://raw.githubusercontent.com/DREAMS-lab/pbr_gazebo/"
    "69e7023511f34f442df357ea7d762316fa648633/models/rock_models/double_rock_pbr_petg/"
    "double_rock_pbr_petg.dae",
    "6ca837688891261ca5d4014cd167abe4b5ec38d5207abaf87240d7d414b6e30b",
)

ORIGINALS = {
    "double_rock": Original(
        *_DOUBLE_ROCK,
        1.5085,
        "DREAMS-lab/pbr_gazebo (Apache-2.0), commit 69e7023, scaled to its height of 1.5085 m",
    ),
    "double_rock_prints": Original(
        *_DOUBLE_ROCK,
        0.120,
        "DREAMS-lab/pbr_gazebo (Apache-2.0), commit 69e7023, scaled to the print's 0.120 m; tests "
        "from DREAMS-lab/shakebot_motion (MIT), commit be66989",
        tests=True,
    ),
    "granite_boulder": Original(
        "https://raw.githubusercontent.com/ZhiangChen/VSR_Pro/"
        "351dd2eaff00f39d75cdc24200020a82525c5d2b/data/granite.obj",
        "6d2320f3d9e7f1ef98d1c096535cd40cf2c5e528dc94744e47beee488c889b0a",
        None,
        "ZhiangChen/VSR_Pro (Apache-2.0), commit 351dd2e, data/granite.obj",
    ),
}
"""By the names that ``make fetch`` takes."""
