"""Dither: what it must do, what it costs, and the choice."""
