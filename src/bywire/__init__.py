"""bywire: a virtual test bench for brake-by-wire actuators."""

from __future__ import annotations

__version__ = "0.1.0"
