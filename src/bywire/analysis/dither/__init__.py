"""Dither: the orbit it makes, what it does to the plant, and its choice."""
