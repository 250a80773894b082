"""Fixtures that tests of the Python interface share."""

from undrawn import drawn, undrawn_unless_asked

__all__ = ["drawn", "undrawn_unless_asked"]
