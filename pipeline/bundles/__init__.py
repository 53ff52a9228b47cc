"""Results as one file that can be handed on, checked and made again elsewhere."""
