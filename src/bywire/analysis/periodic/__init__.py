"""Periodic orbits of a shaken brake, and the map averaged over them."""
