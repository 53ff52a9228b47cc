"""Stages: one module each, with a declaration called STAGE. Heavy libraries load in ``make``."""
