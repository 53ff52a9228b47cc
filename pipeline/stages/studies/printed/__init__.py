"""The published set-up rebuilt, with its parameters as printed."""
