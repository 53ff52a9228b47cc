"""Draws of what is not known: each a rock, a contact, a direction and a gain, and so a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.config import in_si
from pipeline.config.layers import Origin, Site
from pipeline.config.outside import check_regular
from pipeline.config.paths import located, shown
from pipeline.config.priors_schema import PriorsConfig, ScanErrorConfig, UncertaintyConfig
from pipeline.config.problems import InputError, Problem, not_found
from pipeline.config.schema import SceneSettings
from pipeline.stages.mesh import mesh_files, seating
from pipeline.stages.mesh.products import RockData, ScanData, Standing
from pipeline.stages.runs.scenes import Group, Scenes, flat_case, terrain_case
from pipeline.stages.runs.study import Study
from pipeline.stages.uncertainty import seats
from pipeline.stages.uncertainty.seats import DrawnSeat
from pipeline.workflow.datasets import Stored
from pipeline.workflow.keys import check_same, digest_file
from pipeline.workflow.stage import FilesInput
from vsr_core import engines
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import barrier, static_limits
from vsr_core.rock.body import Rock
from vsr_core.rock.solid import block, checked, standing
from vsr_core.rock.tipping import tipping
from vsr_core.run.cases import Case, TerrainCase
from vsr_core.scene import Scene
from vsr_core.uncertainty import search
from vsr_core.validation import priors as physics
from vsr_core.validation.conditioning import effective_number
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
        config.inset,
    )


@dataclass(frozen=True, eq=False)
class Draw:
    """One draw and the rock that comes of it.

    Attributes
    ----------
    yaw : tuple of float [degree], directions of the site
    given : Standing, the rock of the site as it is
    seat : DrawnSeat, None on a flat pedestal
    """

    number: int
    member: Member
    rock: Rock
    settings: SceneSettings
    yaw: tuple[float, ...]
    given: Standing
    seat: DrawnSeat | None = None

    @cached_property
    def scenes(self) -> Scenes:
        """What its scenes are built from."""
        if self.rock is self.given.rock:
            return self.identified
        level = standing(self.rock) if self.seat else self.rock
        return replace(self.identified, standing=Standing(self.rock, barrier(level)))

    @cached_property
    def identified(self) -> Scenes:
        """The same for keys of its runs: with any barrier, as that follows from the rock."""
        ground = self.seat.ground if self.seat else None
        return Scenes(self.settings, Standing(self.rock, self.given.barrier), ground)

    @cached_property
    def cases(self) -> tuple[Case | TerrainCase, ...]:
        """Its scenes, one a direction."""
        place = terrain_case if self.seat else flat_case
        return tuple(place(self.scenes, self.group(yaw)) for yaw in self.yaw)

    def static_limits(self) -> list[tuple[float, float]]:
        """Lowest and highest table acceleration [m/s^2] that move nothing, in each direction."""
        if self.seat:
            return [case.static_limits for case in self.cases]
        contact = in_si.contact(self.settings.contact, self.member.friction)
        return [static_limits(self.rock, contact, yaw) for yaw in self.yaws().tolist()]

    def scales(self) -> Array:
        """What topples it steadily, shape (5, yaws), as ``search.scales`` gives it."""
        if self.seat:
            return search.scales_on(self.seat.outline, self.yaws())
        return search.scales(self.rock.hull, self.yaws())

    def slopes(self, direction: Array) -> Array:
        """Steady acceleration that topples it toward some directions [g].

        Parameters
        ----------
        direction : ndarray, shape (k,) [rad], counter-clockwise from the scan's +x
        """
        if self.seat:
            return search.tipping_on(self.seat.outline, direction)
        return tipping(self.rock.hull, direction).overturning

    @property
    def centre_height(self) -> float:
        """Height of the centre of mass above what bears the rock [m]."""
        return -float(self.seat.outline[:, 2].mean()) if self.seat else self.rock.height

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
        return np.radians([self.group(yaw).yaw for yaw in self.yaw])


def draws(
    study: Study,
    config: UncertaintyConfig,
    density: float,
    shape: Form,
    scan: ScanData | None,
    origin: Origin,
    numbers: Sequence[int],
) -> list[Draw]:
    """Draw a site's rock and shaking as they may be.

    Parameters
    ----------
    density : float [kg m-3]
    scan : ScanData, of rock and ground in one; None on a flat pedestal
    numbers : sequence of int, of the rocks drawn; their shaking is drawn anew, one by one
    """
    given, reduce = study.scenes.standing, study.settings.simulation.reduce
    count = max(*numbers, len(numbers)) + 1
    wanted, found = seats.chosen(config.seat, count), []
    beds = {
        whole: seating.bed(scan.data, given.rock, reduce=reduce, whole_seam=whole)
        for whole in {bearing == "whole" for bearing in wanted}
        if scan
    }
    as_drawn = given.rock.shape == "hull" and scan is None
    known = priors(config if as_drawn else config.model_copy(update={"inset": (0.0, 0.0)}))
    members = physics.draws(known, count)
    with threadpool_limits(1):  # products of some corners: threads would only wait for each other
        for number, (own, shaking) in enumerate(zip(numbers, members, strict=False)):
            member = members[own].shaken_as(shaking)
            contact = {"friction": (member.friction,), "restitution": member.restitution}
            settings = study.settings.with_contact(**contact)
            seat = None
            try:
                if scan is None:
                    rock = _rock(given.rock, shape, member, density)
                else:
                    rock = seats.weighed(given.rock, member.centre)
                    seat = seats.drawn(
                        beds[wanted[own] == "whole"], rock, member, wanted[own], settings, config
                    )
            except InvalidInput as error:
                file = origin.file_of("uncertainty")
                raise InputError.from_invalid(file, "uncertainty", error) from None
            found.append(Draw(number, member, rock, settings, study.yaw, given, seat))
    return found


def _rock(given: Rock, shape: Form, member: Member, density: float) -> Rock:
    """A rock as it may be; that of the site itself where nothing of its shape is drawn."""
    as_scanned = not shape.replica and member.error * shape.spread == 0.0
    if as_scanned and not np.any(member.centre) and not member.inset:
        return given
    return drawn(shape, member, density)


def base_alone(draw: Draw, shape: Form, density: float) -> Rock:
    """The rock of a draw with its base, and the centre of mass where it would be as scanned."""
    member = replace(draw.member, centre=np.zeros(3))
    return _rock(draw.given.rock, shape, member, density)


def surface(rock: RockData, told: ScanErrorConfig, replica: Replica | None) -> Form:
    """The rock's surface, and what is known of its error; a box is as its size says."""
    import trimesh

    vertices = rock.data["surface_vertex"].values.astype(np.float64)
    mesh = trimesh.Trimesh(vertices, rock.data["surface_face"].values, process=False)
    own_error = 0.0 if rock.data.attrs["shape_source"] == "box" else told.error
    if replica is None:
        return form(mesh, None, own_error, told.correlation_length)
    try:
        other = checked(mesh_files.read(replica.path))[0]
        check_same(replica.path, [replica.path], [*replica.before.values()])
    except InvalidInput as error:
        raise replica.refused(f", {error.given}", error.rule, error.remedy) from None
    made = form(mesh, other, own_error, told.correlation_length)
    if not made.replica:
        rule, remedy = "the two scans are of one form", "turn it as the first, or leave it out"
        raise replica.refused(", of another form", rule, remedy)
    return made


@dataclass(frozen=True)
class Replica(FilesInput):
    """A second scan, of the same rock or of a copy of it.

    Attributes
    ----------
    file : str, where it is named
    before : dict, its digest when it was found
    """

    path: Path
    file: str
    before: dict[str, str] = field(default_factory=dict)

    def files_read(self) -> tuple[Path, ...]:
        return (self.path,)

    def digests(self) -> dict[str, str]:
        """Digest of the file, by its name."""
        return {self.path.name: digest_file(self.path)}

    def refused(self, given: str, rule: str, remedy: str) -> InputError:
        """An error that names it."""
        return InputError(Problem(self.file, _REPLICA, f"{shown(self.path)}{given}", rule, remedy))


def find_replica(uncertainty: UncertaintyConfig, origin: Origin) -> Replica | None:
    """The second scan, where one is named."""
    name, file = uncertainty.scan.replica, origin.file_of(_REPLICA)
    if name is None:
        return None
    found = Replica(located(origin.folder_of(_REPLICA), name, file, _REPLICA), file)
    if not found.path.exists():
        raise not_found(file, _REPLICA, shown(found.path))
    try:
        check_regular(found.path, mesh_files.LARGEST_FILE)  # before its digest is taken
    except InvalidInput as error:
        raise found.refused(f", {error.given}", error.rule, error.remedy) from None
    return replace(found, before=found.digests())


def refuse_contact(site: Site) -> None:
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


class Observed(Stored):
    """Draws weighed by what was observed of the rock, and which of them an ensemble takes."""

    FILE = "observations.nc"

    @property
    def rocks(self) -> float:
        """Effective number of the rocks taken, some of them repeatedly (Kish 1965)."""
        taken = self.data["taken"].values
        return effective_number(np.bincount(taken) / len(taken))

    @property
    def repeats(self) -> bool:
        """Whether some are taken repeatedly."""
        return self.rocks < self.data.sizes["member"] - 0.5


class EnsembleData(Stored):
    """Outcomes of every draw, and what is told of them."""

    FILE = "uncertainty.nc"
