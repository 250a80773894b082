"""Measurement files to and from signals over time."""
