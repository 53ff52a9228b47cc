"""How experiments are run: stages, their graph and keys, storage, workers, pages."""
