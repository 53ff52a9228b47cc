"""From a scan or a shape to a rock and its ground."""
