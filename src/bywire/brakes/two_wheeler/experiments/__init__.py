"""Experiments. Those of one test family share a file."""
