"""What the user should know of a recording of the wedge brake: stops, limits, screws that hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.control.moment_control import MOMENT

Rows = NDArray[np.bool_]

_REACHED = 0.95  # of the demanded moment
_LONG = 0.05  # time [s] on the current limit after which a moment counts as out of reach


def watch_wedge(recording: xr.Dataset, known: Mapping[str, Any]) -> list[str]:
    """Return the warnings of a wedge brake; none for other assemblies.

    Parameters
    ----------
    recording
        At least one row.
    known
        The run's parameters by dotted name.
    """
    if not {"F_end", "M_set", "i_1_ref", "i_2_ref"} <= set(recording):
        return []
    return _end_stop(recording) + _limits(recording, known) + _holding_screw(known)


def _end_stop(recording: xr.Dataset) -> list[str]:
    force = np.abs(recording["F_end"].values)
    if not force.any():
        return []
    k = int(np.argmax(force > 0))
    t, x = float(recording["time"].values[k]), 1e3 * float(recording["x"].values[k])
    return [
        f"the wedge reached its end stop at t = {t:.4g} s, x = {x:.3g} mm, and pressed on it with "
        f"up to {force.max():.3g} N: the stop ends the braking moment"
    ]


def _limits(recording: xr.Dataset, known: Mapping[str, Any]) -> list[str]:
    """Return whether the current limit was reached, and whether it keeps a moment out of reach.

    Only under moment control: elsewhere the demanded currents are the test's own.
    """
    if known["command.mode"] != "moment":
        return []
    limit = min(known["control.position.i_max"], known["drive.i_max"])
    refs = [np.abs(recording[name].values) for name in ("i_1_ref", "i_2_ref")]
    limited = np.maximum(*refs) >= limit * (1.0 - 1e-9)
    if not limited.any():
        return []
    t, shown = recording["time"].values, f"the current limit of {limit:.4g} A"
    short = _short_of(recording, known) & limited
    begin, end = _longest(short)
    if t[end] - t[begin] >= _LONG:
        wanted = float(recording["M_set"].values[begin : end + 1].max())
        most = float(np.abs(recording["M_B"].values[begin : end + 1]).max())
        return [
            f"the motors cannot reach the demanded {wanted:.4g} N*m: on {shown} from "
            f"t = {t[begin]:.4g} s to {t[end]:.4g} s, the moment stays at {most:.4g} N*m at most"
        ]
    return [f"{shown} was reached at t = {float(t[int(np.argmax(limited))]):.4g} s"]


def _short_of(recording: xr.Dataset, known: Mapping[str, Any]) -> Rows:
    """Return where a moment is controlled on a turning disc and stays below its demand."""
    turning = np.abs(recording["Omega"].values) > known["control.moment.Omega_still"]
    wanted = _REACHED * recording["M_set"].values
    below = np.abs(recording["y_M"].values) < wanted
    return np.asarray((recording["mode"].values == MOMENT) & turning & below)


def _longest(rows: Rows) -> tuple[int, int]:
    """Return first and last index of the longest stretch of rows; (0, 0) where there is none."""
    edges = np.flatnonzero(np.diff(rows.astype(np.int8), prepend=0, append=0))
    if not edges.size:
        return 0, 0
    begins, ends = edges[::2], edges[1::2] - 1
    k = int(np.argmax(ends - begins))
    return int(begins[k]), int(ends[k])


def _holding_screw(known: Mapping[str, Any]) -> list[str]:
    if known["screw.law"] != "load" or known["screw.eta_b"] != 0.0:
        return []
    return [
        "screw.eta_b = 0: no load drives these screws back, so that the brake keeps its moment "
        "when the power goes off"
    ]
