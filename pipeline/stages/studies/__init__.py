"""Studies beside the main job: accuracy, stability, servo, capacity of a table, validation."""
