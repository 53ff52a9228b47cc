"""What a run is watched for, what ends it, and what can be proved of it: one judge of all engines.

An engine steps a rock and, once in a monitoring interval, writes its state into a ``RunRecord``;
the rest is compiled and stands here once. ``on_pedestal`` judges runs up to their outcomes,
``on_terrain`` runs over a terrain.
"""
