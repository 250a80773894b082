"""Rigs: parts of the vehicle by themselves."""
