"""Rigs and reduced brakes, one file each."""
