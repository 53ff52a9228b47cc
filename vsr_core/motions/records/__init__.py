"""Recorded ground motions: readers, checks, processing, measures, and the motion of a run.

In order: `formats.read` makes a `Record` of a file's content, `checks.sound` repairs or refuses it,
`processing.process` filters it into a `Trace`, `measures.measures` says how strong that is, and
`motion.RecordedMotion` is what a run is given.
"""
