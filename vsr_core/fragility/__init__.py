"""Fragility models for a grid of overturning outcomes.

A grid holds one deterministic run per (PGV/PGA, PGA) cell for one yaw and one friction.
`fit_all` is the entry: it locates the boundary, fits and scores several models and names the
one to use.
"""

from vsr_core.fragility.fit import fit_all
from vsr_core.fragility.result import FragilityResult, ModelFit

__all__ = ["FragilityResult", "ModelFit", "fit_all"]
