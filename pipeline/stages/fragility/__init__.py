"""From responses to fragility models and their figures."""
