"""From hazard curves and a rock's fragility to its survival, and back to the curves."""
