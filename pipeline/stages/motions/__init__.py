"""From the configuration to the ground motions of a study."""
