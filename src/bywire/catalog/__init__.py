"""Cited parameter sets, one file per source."""
