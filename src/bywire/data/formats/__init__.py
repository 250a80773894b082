"""Formats of measurement files, one a module, each with its ``FORMAT``."""
