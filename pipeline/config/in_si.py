"""From the units of a configuration, degrees, g and seconds, to SI."""

from __future__ import annotations

from pipeline.config.schema import Config
from vsr_core.scene import Contact


def contact(config: Config, friction: float) -> Contact:
    """The pair's contact at one friction."""
    return Contact(friction, config.contact.restitution, config.contact.rolling_friction)
