"""What tests of a standing rock in the field teach of it."""
