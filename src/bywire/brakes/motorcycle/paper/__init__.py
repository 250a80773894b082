"""Statements of the source, compared with our results."""
