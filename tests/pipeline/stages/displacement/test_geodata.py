"""What geographic information systems are told of runs, on made-up falls down a plane."""

from __future__ import annotations

import numpy as np
from support import tumbling

from pipeline.stages.displacement import geodata
from vsr_core.outcome import Outcome, StopReason


def test_a_run_without_a_verdict_says_so_beside_the_others() -> None:
    displacement = tumbling.displacement(runs=2, samples=20)
    displacement["outcome"][2] = Outcome.UNSETTLED
    displacement["movement"][2] = -1
    displacement["stop_reason"][2] = StopReason.UNDONE
    (_, runs), _ = geodata.layers(displacement, np.zeros(3))
    found = geodata.attributes(runs)
    said = np.column_stack([found[name] for name in ("outcome", "movement", "ended")])
    assert said.tolist() == [
        ["balanced", "stayed", "came to rest"],
        ["overturned", "rolled over", "came to rest"],
        ["unsettled", "unresolved", "unresolved"],
    ]
