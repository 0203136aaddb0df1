"""Relations between the parts of a valid case."""
