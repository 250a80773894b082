"""Experiments; those of one test family share a file."""
