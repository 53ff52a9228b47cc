"""What a shake table of hardware can do of a grid of motions."""
