"""Comparison of statements in the sources with this model."""
