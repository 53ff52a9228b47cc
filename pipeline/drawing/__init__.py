"""Drawing that any figure may use: the common style, meshes seen from a side, ground from above."""
