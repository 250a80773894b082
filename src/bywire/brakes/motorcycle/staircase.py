"""Staircases of stick and slip in recordings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from bywire.core.typing import Array


@dataclass(frozen=True, eq=False)
class Jumps:
    """Phases of slip between two of stick that raised the pressure.

    ``times``: when each began [s], shape (n,); ``rises``: by how much each raised the pressure
    [Pa], shape (n,); ``levels``: pressures at which each ended [Pa], shape (n,).
    """

    times: Array
    rises: Array
    levels: Array


def jumps(recording: xr.Dataset, least: float = 0.1e5) -> Jumps:
    """Return the jumps of a recording.

    Parameters
    ----------
    recording
        Recording with ``p_mc`` and the mode ``stuck``.
    least
        Smallest rise that counts [Pa]: creeping in small steps, as where a converter's
        resolution moves the current, is no jump.
    """
    time, p = recording["time"].values, recording["p_mc"].values
    stuck = recording["stuck"].values > 0.5
    begins = np.flatnonzero(stuck[:-1] & ~stuck[1:])
    ends = np.flatnonzero(~stuck[:-1] & stuck[1:]) + 1
    stairs = []
    for begin in begins:
        after = ends[ends > begin]
        if after.size and p[after[0]] - p[begin] >= least:
            stairs.append((time[begin], p[after[0]] - p[begin], p[after[0]]))
    table = np.array(stairs).reshape(-1, 3)
    return Jumps(table[:, 0], table[:, 1], table[:, 2])
