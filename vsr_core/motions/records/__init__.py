"""Recorded ground motions: readers, checks, processing, measures, and the motion of a run.

In order: `formats.read` makes a `Record` of a file's content, `record.repaired` repairs or
refuses it, `processing.process` filters it into a `Trace`, `measures.measures` gives its intensity
measures, and `recorded_motion.RecordedMotion` is the motion that a run takes.
"""
