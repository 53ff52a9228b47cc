"""What a hazard reads beside the rock: others at the place, other settings, earlier stages."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import xarray as xr

from pipeline.config.hazard_schema import Age, Comparison, HazardConfig, HazardRock, History
from pipeline.config.layers import Origin, Site, load_site, one_by_one
from pipeline.config.observation_schema import Observations
from pipeline.config.paths import located, shown
from pipeline.config.problems import InputError, Problem
from pipeline.config.set_once import check_set_once
from pipeline.config.slips import warnings
from pipeline.stages.archive import shipped_equations
from pipeline.stages.archive.archived_rock import answered
from pipeline.stages.hazard.ground_shaking import check_peaks
from pipeline.stages.hazard.one_rock import Archived, Other, alike, alike_in_archive
from pipeline.stages.hazard.rock_ages import back_to, check_earthquakes, check_stages, other_age
from pipeline.stages.hazard.rock_fragility import DRAWN, RockFragility
from pipeline.stages.hazard.sensitivity import BASE_CASE
from pipeline.stages.hazard.survival_analysis import DatedRock
from pipeline.stages.mesh.products import RockData
from pipeline.workflow import keys
from pipeline.workflow.grammar import counted
from pipeline.workflow.stage import Input


@dataclass(frozen=True)
class Others(Input):
    """Other rocks at the place, the rock with other settings, and as it stood before.

    Attributes
    ----------
    told : str, which rocks are alike, and what of the command is left out of a comparison
    """

    rocks: tuple[Other | Archived, ...]
    compared: tuple[Other, ...]
    told: tuple[str, ...]
    earlier: tuple[Other, ...]

    def slips(self) -> list[str]:
        """What looks like a common error in the files of other rocks, and of earlier stages."""
        rocks = [one for one in self.made if not any(one is same for same in self.compared)]
        return [f"warning: {told}" for one in rocks for told in warnings(one.site)]

    def files_read(self) -> tuple[Path, ...]:
        archives = (one.path for one in self.rocks if isinstance(one, Archived))
        return (*archives, *(path for one in self.made for path in one.site.read))

    def digests_as_read(self) -> dict[str, str]:
        """The same, of archives as they were when they were found."""
        archives = (one for one in self.rocks if isinstance(one, Archived))
        return self.digests() | {f"archive of {one.name}": one.before for one in archives}

    def digests(self) -> dict[str, str]:
        """Keys of their products, and digests of archives and their equations."""
        found: dict[str, str] = {}
        for place, made in enumerate(self.made):
            name = f"{made.derived}/{made.site.name}"
            found[f"{name} ({place})" if name in found else name] = made.key
        for one in self.rocks:
            if isinstance(one, Archived):
                found[f"archive of {one.name}"] = keys.digest_file(one.path)
                found["equations"] = shipped_equations.digest()
            elif one.history:
                ends = [stage.model_dump(mode="json") for stage in one.history]
                found[f"stages of {one.name}"] = keys.digest(ends)
        return found

    def shapes(self, own: Path) -> dict[str, xr.Dataset]:
        """What ``rock.nc`` holds of the rocks at the place, beside a site's ``own`` products."""
        rocks = (one for one in self.rocks if isinstance(one, Other))
        return {one.name: RockData(one.folder(own)).data for one in rocks}

    @property
    def made(self) -> tuple[Other, ...]:
        """Those with products of their own."""
        rocks = [one for one in self.rocks if isinstance(one, Other)]
        stages = (stage for one in rocks for stage in one.earlier)
        return (*rocks, *stages, *self.compared, *self.earlier)


def find(hazard: HazardConfig, origin: Origin) -> Others:
    """What a site's hazard names beside the site itself."""
    assert origin.request is not None
    file, study, settings = origin.request
    if hazard.history:
        _check_request(origin, study, settings)
    drawn = hazard.support == "tested"
    earlier = _stages(hazard.history, hazard.age, origin, drawn)
    rocks = tuple(_other(rock, origin, drawn) for rock in hazard.rocks)
    named = [origin.name]
    for stage in (stage for rock in rocks for stage in rock.earlier):
        if stage.name == origin.name:  # whose folder would be taken for that of the site
            rule = "each rock, and each of its stages, has a name of its own"
            file, given = origin.file_of("hazard.rocks"), f"a stage named {stage.name}"
            remedy = "rename one, or leave it out"
            raise InputError(Problem(file, "hazard.rocks", given, rule, remedy))
    for key, others in (("hazard.history", earlier), ("hazard.rocks", rocks)):
        for other in others:
            if other.name in named:
                file, given = origin.file_of(key), f"{other.name} twice"
                rule = "each rock is counted once, and has a name of its own"
                raise InputError(Problem(file, key, given, rule, "leave it out, or rename"))
            named.append(other.name)
    archived = [one for one in rocks if isinstance(one, Archived)]
    same = list(alike_in_archive(archived))
    if made := [one for one in rocks if isinstance(one, Other)]:
        site = load_site(file, study, settings)
        own = Other(site.name, site, ".", drawn and site.config.uncertain)
        same += alike(origin, own, *made)
    names = [BASE_CASE, *(one.name for one in hazard.compare)]
    folders = [folder_of(" ".join(name.split())).lower() for name in names]
    if len(set(folders)) < len(folders):
        twice = next(name for n, name in enumerate(names) if folders.count(folders[n]) > 1)
        file, rule = origin.file_of("hazard.compare"), "a comparison has a name of its own"
        raise InputError(Problem(file, "hazard.compare", f"{twice!r} twice", rule, "rename one"))
    compared, told = _compared(hazard, origin)
    ages = [
        line
        for given, one in zip(hazard.rocks, rocks, strict=True)
        if isinstance(one, Archived)
        for line in other_age(one.name, given.age, one.age)
    ]
    return Others(rocks, compared, (*same, *ages, *told), earlier)


def _compared(hazard: HazardConfig, origin: Origin) -> tuple[tuple[Other, ...], tuple[str, ...]]:
    """The rock with other settings, and in lines what of the command these do not go with."""
    compared, told = [], []
    for one in hazard.compare:
        try:
            check_set_once(one.set)
            site, without = _with_other_settings(one, origin)
            check_peaks(site)
        except InputError as error:
            raise _of_comparison(origin, one.name, error) from None
        _check_comparison(origin, one, site)
        compared.append(Other(one.name, site, folder_of(one.name)))
        place = f"{origin.file_of('hazard.compare')}: hazard.compare: {one.name}"
        told += [f"{place}: {slip}" for slip in warnings(site) if _is_own(slip.key, site, origin)]
        if without:
            told.append(f"{place}: {one.study} does not go with {without}; compared without")
    return tuple(compared), tuple(told)


def _is_own(key: str, site: Site, origin: Origin) -> bool:
    """Whether a comparison sets a key itself."""
    place = tuple(key.split("."))
    return site.places.get(place) != origin.places.get(place)


def _with_other_settings(one: Comparison, origin: Origin) -> tuple[Site, str]:
    """The rock as it is compared, and what of the command its study does not go with."""
    assert origin.request is not None
    file, study, settings = origin.request
    if one.study is None:
        return load_site(file, study, (*settings, *one.set)), ""
    over = _named(one.study, origin, "hazard.compare"), one.set
    try:
        return load_site(file, study, settings, over), ""
    except InputError as error:
        try:
            return load_site(file, study, settings, over, "motion"), "the motion of the command"
        except InputError:
            raise error from None


def _check_comparison(origin: Origin, one: Comparison, site: Site) -> None:
    """Refuse a comparison by what is no part of a rock's fragility."""
    keys = [setting.partition("=")[0].strip() for setting in one_by_one(one.set)]
    mine = {key: place for key, place in site.places.items() if origin.places.get(key) != place}
    keys += sorted(_set_by_study(replace(site, places=mine)))
    others = [key for key in keys if key.partition(".")[0] in _NOT_COMPARED]
    if others:
        place, rule = "hazard.compare", "a comparison is of another fragility of the rock"
        remedy = "give another command with it"
        raise InputError(Problem(origin.file_of(place), place, others[0], rule, remedy))


_NOT_COMPARED = {"hazard", "uncertainty", "observations"}


def _set_by_study(origin: Origin) -> set[str]:
    """Sections in which a study sets keys."""
    own = shown(origin.path), "--"
    return {key[0] for key, (at, _) in origin.places.items() if not at.startswith(own)}


def _of_comparison(origin: Origin, name: str, error: InputError) -> InputError:
    """The same refusals, which say that they are of a comparison and not of the site itself."""
    file = origin.file_of("hazard.compare")
    return InputError(
        *(
            replace(
                one,
                file=file,
                key=f"hazard.compare: {name}: {one.key}",
                remedy=f"{one.remedy}, or compare with nothing: --set hazard.compare=[]",
            )
            for one in error.problems
        )
    )


_SECTION = re.compile(r"[.=\s]")


def _check_request(origin: Origin, study: str | None, settings: tuple[str, ...]) -> None:
    """Refuse what would change the rock as it stands now, and not as it stood before."""
    kept = {"hazard", "simulation"}
    own = [one for one in one_by_one(settings) if _SECTION.split(one.strip())[0] not in kept]
    of_study = _set_by_study(origin) - kept
    if of_study or own:
        given = f"the study {study}" if of_study else f"--set {own[0]}"
        rule = "stages of a rock keep the settings of their own files"
        remedy = "write it into the files of the rock and of its stages"
        raise InputError(
            Problem(origin.file_of("hazard.history"), "hazard.history", given, rule, remedy)
        )


def _other(rock: HazardRock, origin: Origin, drawn: bool) -> Other | Archived:
    """Another rock; one of an archive is read already, so that no run precedes its refusal."""
    key, name = "hazard.rocks", rock.site
    if rock.archive is not None:
        path = located(origin.folder_of(key), rock.archive, origin.file_of(key), key)
        found = answered(path, name)
        medians = tuple(np.sort(found.median, axis=0).ravel().tolist())
        return Archived(name, path, keys.digest_file(path), age=found.age, medians=medians)
    other = _of_site(name, origin, key, drawn)
    check_stages(other.site, rock.age)
    return replace(other, earlier=_stages(other.history, rock.age, other.site.origin, drawn))


def _stages(history: History, age: Age | None, origin: Origin, drawn: bool) -> tuple[Other, ...]:
    """A rock as it stood before, each time in the years of that stage."""
    found = tuple(_of_site(one.site, origin, "hazard.history", drawn) for one in history)
    times = pairwise((*(one.until for one in history), age))
    for stage, (until, since) in zip(found, times, strict=True):
        check_earthquakes(stage.site, since, " as it stood then", until)
    return found


def _of_site(name: str, origin: Origin, key: str, drawn: bool) -> Other:
    """A rock by the site that a key names, by its draws or as scanned."""
    site = load_site(_named(name, origin, key))
    check_peaks(site)
    return Other(site.name, site, "..", drawn and site.config.uncertain)


def _named(name: str, origin: Origin, key: str) -> str:
    """A shipped file by its name, another by its path from the file that names it."""
    return str(origin.folder_of(key) / name) if name.endswith((".yaml", ".yml")) else name


def folder_of(name: str) -> str:
    """Folder of a comparison, below the site's own products.

    Examples
    --------
    >>> folder_of("friction 0.4")
    'compared/friction_0.4'
    """
    return "compared/" + re.sub(r"[^A-Za-z0-9._-]", "_", name)


def dated(
    folder: Path,
    name: str,
    now: RockFragility,
    age: Age,
    history: History,
    observed: Observations,
    earlier: Sequence[Other],
) -> DatedRock:
    """A rock with its stages, whose products lie where those in a folder say."""
    seen = (observed, *(stage.observed for stage in earlier))
    *ended, ages = back_to(age, history, *seen).T
    before = [stage.fragility(folder) for stage in earlier]
    rock = DatedRock(name, now, ages, tuple(zip(before, ended, strict=True)))
    of_draws = [one.numbers for one in rock.stages if one.source == DRAWN]
    for stage, fragility in zip(earlier, before, strict=True):
        if fragility.source != DRAWN:
            continue
        if len(lost := np.setdiff1d(of_draws[0], fragility.numbers)):
            key, rule = "uncertainty.members", "what is unknown of a rock stays through its stages"
            given = f"{counted(len(lost), 'draw')} of {name} that {stage.name} has not"
            number = max(of_draws[0]) + 1
            remedy = f"set uncertainty.members: {number} there, without observations, "
            remedy += "or hazard.support: scan for the rock"
            raise InputError(Problem(stage.site.file_of(key), key, given, rule, remedy))
    return rock
