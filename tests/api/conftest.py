"""What the tests of the Python face share."""

from undrawn import drawn, undrawn_unless_asked

__all__ = ["drawn", "undrawn_unless_asked"]
