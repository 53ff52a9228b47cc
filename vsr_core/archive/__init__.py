"""Archives: rocks known by two angles and a distance, and equations that stand for runs."""
