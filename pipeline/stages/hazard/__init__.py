"""From a hazard model's curves and a rock's fragility to its survival, and back to the curves."""
