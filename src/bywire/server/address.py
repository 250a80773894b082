"""Address of the server: only this machine can reach it."""

from __future__ import annotations

from typing import Final

PORT: Final = 8642
"""default port"""
HERE: Final = "127.0.0.1"
NAMES: Final = (HERE, "localhost")
"""names of this machine that are valid in a link"""
