"""Fragility models for a grid of overturning outcomes.

A grid holds one deterministic run per (PGV/PGA, PGA) cell for one yaw and one friction.
`fit_all` is the entry: it locates the boundary, fits and scores several models and names the
one to use. scipy and scikit-learn are imported when it is called, not before.
"""

from vsr_core.fragility.fit import fit_all
from vsr_core.fragility.result import Boundary, FragilityResult, ModelFit, Parameter, Scores

__all__ = ["Boundary", "FragilityResult", "ModelFit", "Parameter", "Scores", "fit_all"]
