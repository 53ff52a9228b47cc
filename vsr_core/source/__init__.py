"""Source of this project: the definitions in it, and which of them a result is made from."""
