"""What a line of a figure means; loads no plotting, so that brakes may declare panels."""

from __future__ import annotations

from enum import Enum


class Role(Enum):
    """What a line means; the same meaning looks the same in every figure."""

    MAIN = "main"
    SECOND = "second"
    SET_POINT = "set point"
    MEASURED = "measured"
    SIMULATED = "simulated"
    LIMIT = "limit"
