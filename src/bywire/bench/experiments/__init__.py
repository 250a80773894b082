"""Generic experiments, one per file."""
