"""Sizing studies, one file each."""
