"""What was observed of a rock in the field, and what that teaches of it."""
