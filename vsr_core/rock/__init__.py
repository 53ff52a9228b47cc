"""A rock as a rigid body: its solid, its convex hull, how it rests and tips, its reductions."""
