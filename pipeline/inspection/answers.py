"""What plan, status, why and list tell: as lines for a reader, and as JSON for a program."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipeline.inspection import disk
from pipeline.workflow.grammar import counted

VERSION = 1
"""Of the shapes below, in each answer: another one where a field changes its meaning or goes."""


@dataclass(frozen=True)
class Made:
    """A stage; reasons why it would be made again, none where it is up to date."""

    stage: str
    reasons: list[str]


@dataclass(frozen=True)
class Stored:
    """Runs that are wanted and those that are stored, by their outcomes."""

    wanted: int
    stored: int
    outcomes: dict[str, int]


@dataclass(frozen=True)
class Why:
    """Why a product of a site would be made again.

    Attributes
    ----------
    runs : Stored or None, the latter where no run is known yet
    """

    site: str
    folder: str
    stages: list[Made]
    settings: list[str]
    runs: Stored | None

    def lines(self) -> list[str]:
        """A line for each reason."""
        lines = []
        for one in self.stages:
            lines += [f"{one.stage}: {reason}" for reason in one.reasons or ["up to date"]]
        lines += self.settings
        if self.runs:
            kept, total = self.runs.stored, self.runs.wanted
            lines.append(f"runs: {kept} of {total} are stored and stay; {total - kept} to do")
        return lines


@dataclass(frozen=True)
class Status:
    """What is done of a product of a site.

    Attributes
    ----------
    bytes : int, of all files in the folder
    days : float or None, since the newest product there was made
    others : list of str, products that are there beside it and what it needs
    """

    site: str
    folder: str
    stages: list[Made]
    stale: list[str]
    runs: Stored | None
    bytes: int
    days: float | None
    others: list[str]

    def lines(self) -> list[str]:
        """A line for each stage and each outcome."""
        room = f": {disk.told(self.bytes, self.days)}" if self.bytes else ""
        lines = [f"{self.site} in {self.folder}{room}"]
        for one in self.stages:
            done = f"to do: {one.reasons[0]}" if one.reasons else "done"
            lines.append(f"  {one.stage:<20}{done}")
        lines += [f"  {line}" for line in self.stale]
        if self.runs:
            lines.append(f"  {self.runs.stored} of {self.runs.wanted} runs stored")
            lines += [f"    {number:>7} {name}" for name, number in self.runs.outcomes.items()]
        return lines + [f"  also there: {', '.join(self.others)}"] * bool(self.others)


@dataclass(frozen=True)
class Room:
    """A folder of results: bytes of all files, and days since the newest product was made."""

    name: str
    bytes: int
    days: float | None


@dataclass(frozen=True)
class Overview:
    """All folders of results in the one that holds them."""

    folder: str
    results: list[Room]
    version: int = VERSION

    def lines(self) -> list[str]:
        """A line for each."""
        lines = [f"{one.name:<30}  {disk.told(one.bytes, one.days)}" for one in self.results]
        return lines or [f"no results in {self.folder}"]


@dataclass(frozen=True)
class Record:
    """A recorded motion: its length [s] and PGV/PGA [s]."""

    name: str
    duration: float
    pgv_pga: float


@dataclass(frozen=True)
class Runs:
    """Runs of a plan.

    Attributes
    ----------
    proved : int, of those to do, whose outcome is proved without a step
    time_steps : list of float [s], empty where they are measured first
    seconds, workers, ms_a_run : what it costs, and of what that is made
    measured : bool, whether the time of a run was measured here
    pga : int, PGAs of each record
    again : bool, whether as many runs are done without vertical components
    """

    wanted: int
    stored: int
    to_do: int
    proved: int
    time_steps: list[float]
    seconds: float
    workers: int
    ms_a_run: float
    measured: bool
    records: list[Record]
    pga: int
    again: bool

    def lines(self) -> list[str]:
        """What is to do, and what it costs."""
        text = ", ".join(f"{1e3 * step:.3g} ms" for step in self.time_steps)
        source = "as measured here" if self.measured else "typical"
        lines = [f"records: {len(self.records)}, each at {self.pga} PGA"] if self.records else []
        lines += [
            f"  {one.name}: {one.duration:.1f} s, PGV/PGA {one.pgv_pga:.3g} s"
            for one in self.records
        ]
        return [
            *lines,
            f"runs: {self.wanted}; {self.stored} stored, {self.to_do} to do, "
            f"{self.proved} of them proved without a step",
            f"time step: {text or 'measured on the scene first, some seconds'}",
            f"cost: about {self.seconds:.0f} s on {self.workers} workers at "
            f"{self.ms_a_run:.1f} ms a run ({source})",
            *["as many runs again: without vertical components"] * self.again,
        ]


@dataclass(frozen=True)
class Beside:
    """Runs beside those of the grid, about so many: of a boundary, or of draws.

    Attributes
    ----------
    each : int, runs of a level; levels : of one draw
    """

    runs: int
    each: int
    levels: int
    draws: int = 0

    def line(self) -> str:
        """What they are for."""
        if self.draws:
            return (
                f"draws: {self.draws}, each with {self.levels} first overturnings, of "
                f"{self.each} runs as a rule: about {self.runs} runs beside"
            )
        return (
            f"boundary: about {self.runs} runs beside, {self.each} in each of {self.levels} "
            "levels where the outcome changes once"
        )


@dataclass(frozen=True)
class Plan:
    """What would run, what it costs, and what is left out of the scene.

    Attributes
    ----------
    runs : Runs or None, the latter for a product without any
    left_out : list of str, what is left out of the scene; empty where nothing is
    off : list of str, reductions that these motions switch off
    """

    site: str
    folder: str
    stages: list[str]
    runs: Runs | None = None
    beside: list[Beside] = field(default_factory=list)
    contact: str = ""
    left_out: list[str] = field(default_factory=list)
    off: list[str] = field(default_factory=list)

    def lines(self) -> list[str]:
        """Stages, runs, and what is left out."""
        lines = [f"stages to make: {', '.join(self.stages) or 'none'}"]
        if self.runs is None:
            return lines
        lines += [*self.runs.lines(), *(one.line() for one in self.beside)]
        lines += [f"contact on the terrain: {self.contact}"] if self.contact else []
        left_out = [f"  {one}" for one in self.left_out]
        return [
            *lines,
            "left out:",
            *(left_out or ["  nothing (simulation.reduce: off)"]),
            *(f"switched off: {one}" for one in self.off),
        ]


@dataclass(frozen=True)
class Known:
    """Names that a command takes."""

    sites: list[str]
    studies: list[str]
    tables: list[str]
    products: list[str]
    version: int = VERSION

    def lines(self) -> list[str]:
        """A line for each kind."""
        return [
            " ".join(["sites:   ", *self.sites]),
            " ".join(["studies: ", *(self.studies or ["none"])]),
            " ".join(["tables:  ", *self.tables]),
            " ".join(["products:", *self.products]),
        ]


@dataclass(frozen=True)
class Comparison:
    """Members of a sweep, in the order of the answers, and why they are not compared yet."""

    folder: str
    members: list[str]
    reasons: list[str]


@dataclass(frozen=True)
class Inspected:
    """Answers about a site and the rocks that its hazard reads, or about the members of a sweep."""

    question: str
    product: str
    answers: list[Why | Status | Plan]
    comparison: Comparison | None = None
    version: int = VERSION

    def lines(self) -> list[str]:
        """The lines of every answer, and of what compares them."""
        head = [f"status of {self.product}:"] if self.question == "status" else []
        if self.comparison is None:
            first, *others = self.answers
            return [
                *head,
                *first.lines(),
                *(line for one in others for line in (f"{one.folder}:", *one.lines())),
            ]
        swept = self.comparison
        lines = [*head, f"{counted(len(swept.members), 'member')} in {swept.folder}"]
        for name, answer in zip(swept.members, self.answers, strict=True):
            lines += [f"{name}:", *(f"  {line}" for line in answer.lines())]
        return [*lines, *(f"study: {reason}" for reason in swept.reasons or ["up to date"])]


Answer = Inspected | Overview | Known
"""What ``--json`` prints."""
