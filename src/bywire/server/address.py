"""Where a server listens: on this machine, and on nothing else."""

from __future__ import annotations

from typing import Final

PORT: Final = 8642
"""port by default"""
HERE: Final = "127.0.0.1"
NAMES: Final = (HERE, "localhost")
"""how this machine may be called in a link"""
