"""Strokes of a sealed piston, and the friction that they show."""
