"""The ground that a rock stands on: lookups, fewer triangles, convex parts."""
