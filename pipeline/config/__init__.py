"""The configuration: sections and their ranges, layers of YAML, and problems told in one line."""
