"""Figures that bywire does not include, one file each."""
