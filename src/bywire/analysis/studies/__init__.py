"""Sizing studies of the brakes, one file each."""
