"""Identification methods, one a file; each module has one ``METHOD``."""
