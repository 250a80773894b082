"""Rigs, one file each."""
