"""How a servo-driven table follows its motions."""
