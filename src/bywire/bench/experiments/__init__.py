"""Virtual tests, one per file."""
