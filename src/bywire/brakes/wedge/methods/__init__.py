"""Identification methods, one file each; what several share in a folder."""
