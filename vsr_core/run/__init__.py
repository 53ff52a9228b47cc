"""One run: its settings, its rules for overturning and displacement, its guards and proofs."""
