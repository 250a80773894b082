"""How recordings of the wedge brake are read: the disc's direction, its revolutions, their rows."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr


def along_disc(run: xr.Dataset) -> xr.Dataset:
    """Return a recording whose moments and speed count positive in the disc's first direction."""
    if not float(run["Omega"].values[0]) < 0:
        return run
    # Not negated, which would make negative zeros.
    return run.assign({name: 0.0 - run[name] for name in ("M_B", "y_M", "Omega")})


def last_turn(run: xr.Dataset, begin: float, end: float) -> float | None:
    """Return when the disc's last revolution before a time begins [s]; None if before another."""
    nearest = int(np.abs(run["time"].values - end).argmin())
    speed = abs(float(run["Omega"].values[nearest]))
    if speed * (end - begin) < 2.0 * math.pi:
        return None
    return end - 2.0 * math.pi / speed


def too_coarse(run: xr.Dataset, begin: float, end: float, rows: int = 1) -> str:
    """Return why rows are too far apart to judge a moment between two times [s]; else "".

    Parameters
    ----------
    rows
        Least number of rows in that time; a revolution of the disc takes five, or the run-out's
        oscillation would be taken for something else.
    """
    t = run["time"].values
    apart = float(np.diff(t).max()) if t.size > 1 else math.inf
    speed = float(np.abs(run["Omega"].values).max())
    fifth = 0.4 * math.pi / speed if speed > 0 else math.inf
    inside = np.count_nonzero((t >= begin - 1e-9) & (t <= end + 1e-9))
    if inside >= rows and apart <= 1.05 * fifth:  # what the message says is rounded
        return ""
    wanted = min((end - begin) / rows, fifth)
    return (
        f"rows {apart:.3g} s apart are too few between t = {begin:.4g} s and {end:.4g} s: "
        f"record every {wanted:.2g} s or more often"
    )
