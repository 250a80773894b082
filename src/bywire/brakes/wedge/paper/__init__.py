"""Statements of the source, and the computed values."""
