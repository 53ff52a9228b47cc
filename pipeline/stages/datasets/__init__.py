"""From stored runs to datasets."""
