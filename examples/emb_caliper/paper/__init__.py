"""Statements of the sources, compared with this model."""
