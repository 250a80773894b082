"""How much is held in memory at most, unless more is asked for."""

from __future__ import annotations

from bywire.core.machine_memory import machine_memory

_MOST = 8 * 2**30  # bytes
_SHARE = 0.5  # of the machine's memory: what is read is turned over once


def room() -> int:
    """Return the bytes of numbers that are held at most: 8 GiB, or half the machine's memory."""
    return min(_MOST, int(_SHARE * machine_memory()))
