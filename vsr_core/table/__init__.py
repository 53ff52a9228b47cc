"""The shake table: the servo that drives it, and what a table of hardware can do."""
