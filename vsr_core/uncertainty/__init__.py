"""What is not known of a rock, and what that does to its overturning: draws, boundary, shares."""
