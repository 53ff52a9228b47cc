"""Draws of what is not known: each a rock, a contact, a direction and a gain, and so a scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from pipeline.config import in_si
from pipeline.config.layers import Site
from pipeline.config.paths import located, shown
from pipeline.config.priors_schema import PriorsConfig
from pipeline.config.problems import InputError, Problem, not_found
from pipeline.config.schema import Config
from pipeline.stages.mesh import mesh_files
from pipeline.stages.mesh.products import ROCK, load_rock
from pipeline.stages.runs.scenes import Group, Scenes
from pipeline.workflow.datasets import read
from pipeline.workflow.keys import digest_file
from pipeline.workflow.store import Store
from vsr_core import engines
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import Barrier, barrier
from vsr_core.rock.body import Rock
from vsr_core.rock.solid import block, checked
from vsr_core.scene import Scene
from vsr_core.validation import priors as physics
from vsr_core.validation.priors import Member, Priors
from vsr_core.validation.specimen import Form, drawn, form

_REPLICA = "uncertainty.scan.replica"


def priors(config: PriorsConfig) -> Priors:
    """Put what is not known of a rock and its shaking in the terms of the physics."""
    return Priors(
        (in_si.angle(config.azimuth.mean), in_si.angle(config.azimuth.sd)),
        config.polarity_reversal_probability,
        config.friction,
        config.restitution,
        (config.amplitude.mean, config.amplitude.sd),
        config.replica_fraction,
        config.base_error,
        config.centre_of_mass,
    )


@dataclass(frozen=True, eq=False)
class Draw:
    """One draw and the rock that comes of it.

    Attributes
    ----------
    given : (Rock, Barrier) of the site as it is
    """

    number: int
    member: Member
    rock: Rock
    config: Config
    given: tuple[Rock, Barrier]

    @cached_property
    def scenes(self) -> Scenes:
        """What its scenes are built from."""
        limits = self.given[1] if self.rock is self.given[0] else barrier(self.rock)
        return Scenes(self.config, self.rock, limits, None)

    def group(self, yaw: float) -> Group:
        """The scene of a direction.

        Parameters
        ----------
        yaw : float [degree], of the site
        """
        return Group(yaw - in_si.in_degrees(self.member.direction), self.member.friction)

    def yaws(self) -> Array:
        """Directions of its scenes.

        Returns
        -------
        ndarray, shape (yaws,) [rad]
        """
        return np.radians([self.group(yaw).yaw for yaw in self.config.yaw])


def draws(site: Site, store: Store, shape: Form) -> list[Draw]:
    """Draw the members of a site's ensemble."""
    config, given = site.config, load_rock(store)
    members = physics.draws(priors(config.uncertainty), config.uncertainty.members)
    found = []
    for number, member in enumerate(members):
        contact = {"friction": (member.friction,), "restitution": member.restitution}
        own = config.contact.model_copy(update=contact)
        own_config = config.model_copy(update={"contact": own})
        try:
            rock = _rock(given[0], shape, member, config.rock.density)
        except InvalidInput as error:
            raise InputError.from_invalid(
                site.file_of("uncertainty"), "uncertainty", error
            ) from None
        found.append(Draw(number, member, rock, own_config, given))
    return found


def _rock(given: Rock, shape: Form, member: Member, density: float) -> Rock:
    """A rock as it may be; that of the site itself where nothing of its shape is drawn."""
    as_scanned = not shape.replica and member.error * shape.spread == 0.0
    if as_scanned and not np.any(member.centre):
        return given
    return drawn(shape, member, density)


def base_alone(draw: Draw, shape: Form) -> Rock:
    """The rock of a draw with its base, and the centre of mass where it would be as scanned."""
    member = replace(draw.member, centre=np.zeros(3))
    return _rock(draw.given[0], shape, member, draw.config.rock.density)


def surface(site: Site, store: Store) -> Form:
    """The rock's surface, and what is known of its error; a box is as its size says."""
    import trimesh

    told, data = site.config.uncertainty.scan, read(store.folder / ROCK)
    vertices = data["surface_vertex"].values.astype(np.float64)
    mesh = trimesh.Trimesh(vertices, data["surface_face"].values, process=False)
    own_error = 0.0 if site.config.rock.shape == "box" else told.error
    path = replica_path(site)
    if path is None:
        return form(mesh, None, own_error, told.correlation_length)
    try:
        other = checked(mesh_files.read(path))[0]
    except InvalidInput as error:
        raise _refused(site, f"{shown(path)}, {error.given}", error.rule, error.remedy) from None
    made = form(mesh, other, own_error, told.correlation_length)
    if not made.replica:
        given, rule = f"{shown(path)}, of another form", "the two scans are of one form"
        raise _refused(site, given, rule, "turn it as the first, or leave it out")
    return made


def replica_path(site: Site) -> Path | None:
    """Path of the second scan, where one is named."""
    name = site.config.uncertainty.scan.replica
    if name is None:
        return None
    path = located(site.folder_of(_REPLICA), name, site.file_of(_REPLICA), _REPLICA)
    if not path.is_file():
        raise not_found(site.file_of(_REPLICA), _REPLICA, shown(path))
    return path


def inputs(site: Site) -> dict[str, str]:
    """Digest of the second scan, for the identity of the stage."""
    path = replica_path(site)
    _check_contact(site)
    return {} if path is None else {path.name: digest_file(path)}


def _refused(site: Site, given: str, rule: str, remedy: str) -> InputError:
    return InputError(Problem(site.file_of(_REPLICA), _REPLICA, given, rule, remedy))


def _check_contact(site: Site) -> None:
    """Refuse restitutions that the engine does not have, before the first draw."""
    config, most = site.config, site.config.uncertainty.restitution[1]
    own = config.contact.model_copy(update={"restitution": most})
    scene = Scene(block((0.5, 0.5, 1.0), 1.0), in_si.contact(own, config.contact.friction[0]), 0.0)
    try:
        engines.load(config.engine).build(scene, 1e-3, 1)
    except InvalidInput as error:
        key = "uncertainty.restitution"
        remedy = f"set {key}: [0, 0], or simulation.engine: auto"
        raise InputError(Problem(site.file_of(key), key, error.given, error.rule, remedy)) from None
