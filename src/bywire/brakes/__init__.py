"""Brakes as packages: each holds all that it alone knows. No general room imports them."""
