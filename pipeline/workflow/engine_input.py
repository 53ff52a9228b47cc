"""The engine of a site as an input: its version counts, and its library has to be there."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Annotated

import numpy as np

from pipeline.config.layers import Origin
from pipeline.config.problems import InputError
from pipeline.config.sections import Key
from pipeline.workflow.stage import Input
from vsr_core import engines
from vsr_core.errors import InvalidInput
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact, Scene


@dataclass(frozen=True)
class Engine(Input):
    """An engine whose library is installed."""

    name: str
    version: str
    code: tuple[str, ...]

    def digests(self) -> dict[str, str]:
        """Its version."""
        return {f"engine {self.name}": self.version}

    def get_ready(self) -> None:
        """Load its machine code, by the world of a block."""
        corners = np.array(list(product((-1.0, 1.0), repeat=3)))
        block = Rock("hull", corners, 1.0, np.ones(3), np.eye(3))
        engines.load(self.name).build(Scene(block, Contact(1.0)), 1e-3, 1)


def find(name: Annotated[str, Key("engine")], origin: Origin) -> Engine:
    """The engine that a site names, or that ``auto`` stands for."""
    try:
        return Engine(name, engines.load(name).VERSION, (f"vsr_core.engines.{name}:build",))
    except InvalidInput as error:
        file = origin.file_of("simulation.engine")
        raise InputError.from_invalid(file, "simulation.engine", error) from None
