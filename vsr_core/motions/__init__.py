"""Motions of the table: the cosine pulse, up to six axes, recorded ground motions."""
