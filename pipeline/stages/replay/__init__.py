"""Single runs of a study, played in a page."""
