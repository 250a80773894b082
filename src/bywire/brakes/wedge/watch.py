"""What the user should know of a recording of the wedge brake: stops, limits, screws that hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.brakes.wedge.laws.moment_control import MOMENT
from bywire.core.parameters import ParameterSet

Rows = NDArray[np.bool_]

_REACHED = 0.95  # of the demanded moment
_LONG = 0.05  # time [s] on the current limit after which a moment counts as out of reach
_SWINGS = 10  # reversals on the current limit, each within _LONG of the last, that a step never has


def watch(recording: xr.Dataset, par: ParameterSet) -> list[str]:
    """Return the warnings of a wedge brake; none where the recording lacks its signals.

    ``recording``: at least one row.
    """
    known = par.flat()
    if not {"F_end", "M_set", "i_1_ref", "i_2_ref"} <= set(recording):
        return []
    warnings = _end_stop(recording)
    if known["command.mode"] == "moment":  # elsewhere the demanded currents are the test's own
        warnings += _out_of_reach(recording, known) or _not_reached(recording, known)
        warnings += _limits(recording, known)
    return warnings + _holding_screw(known)


def _end_stop(recording: xr.Dataset) -> list[str]:
    force = np.abs(recording["F_end"].values)
    if not force.any():
        return []
    k = int(np.argmax(force > 0))
    when, x = _when(recording, k), 1e3 * float(recording["x"].values[k])
    return [
        f"the wedge reached its end stop {when}, x = {x:.3g} mm, and pressed on it with "
        f"up to {force.max():.3g} N: the stop ends the braking moment"
    ]


def _when(recording: xr.Dataset, k: int) -> str:
    """Return when something first shows; in the first row it has begun before."""
    t = float(recording["time"].values[k])
    return "before the recording starts" if k == 0 else f"at t = {t:.4g} s"


def _limit(known: Mapping[str, Any]) -> float:
    return float(min(known["control.position.i_max"], known["drive.i_max"]))


def _limited(recording: xr.Dataset, known: Mapping[str, Any]) -> Rows:
    """Return where a motor's demanded current is at its limit."""
    refs = [np.abs(recording[name].values) for name in ("i_1_ref", "i_2_ref")]
    return np.asarray(np.maximum(*refs) >= _limit(known) * (1.0 - 1e-9))


def _out_of_reach(recording: xr.Dataset, known: Mapping[str, Any]) -> list[str]:
    """Return whether the current limit keeps a moment out of reach as long as it is demanded."""
    begin, end = _longest(_short_of(recording, known) & _limited(recording, known))
    t, demand = recording["time"].values, recording["M_set"].values
    wanted = float(demand[begin : end + 1].max())
    moment = np.abs(recording["M_B"].values)
    most = float(moment[demand >= _REACHED * wanted].max())
    if t[end] - t[begin] < _LONG or most >= _REACHED * wanted or _swings(recording, known):
        return []
    return [
        f"the motors cannot reach the demanded {wanted:.4g} N*m: on the current limit of "
        f"{_limit(known):.4g} A from t = {t[begin]:.4g} s to {t[end]:.4g} s, the moment stays at "
        f"{most:.4g} N*m at most"
    ]


def _not_reached(recording: xr.Dataset, known: Mapping[str, Any]) -> list[str]:
    """Return whether the largest demand was never met, whatever the cause."""
    wanted = float(recording["M_set"].values.max())
    most = float(np.abs(recording["M_B"].values).max())
    sparse = np.diff(recording["time"].values).max(initial=0.0) > _LONG  # may miss the peak
    if sparse or most >= _REACHED * wanted:
        return []
    text = f"the demand of {wanted:.4g} N*m was not reached: the moment is {most:.4g} N*m at most"
    M_on, speed = known["control.moment.M_on"], np.abs(recording["Omega"].values).max()
    if wanted <= M_on:
        text += f", as the brake stays parked up to control.moment.M_on = {M_on:.4g} N*m"
    elif speed < known["control.moment.Omega_still"]:
        text += ", as the disc stands"
    return [text]


def _limits(recording: xr.Dataset, known: Mapping[str, Any]) -> list[str]:
    """Return whether the current limit was reached in passing, or is swung between."""
    limited, limit = _limited(recording, known), _limit(known)
    if not limited.any() or _out_of_reach(recording, known):
        return []
    swings = _swings(recording, known)
    if swings:
        begin, end, number = swings
        return [
            f"the demanded current swings between its limits of -{limit:.4g} A and {limit:.4g} A, "
            f"{number} times from t = {begin:.4g} s to {end:.4g} s: a loop is likely unstable, "
            "see 'bywire margins position' and 'bywire margins moment'"
        ]
    k = int(np.argmax(limited))
    return [f"the current limit of {limit:.4g} A was reached {_when(recording, k)}"]


def _swings(recording: xr.Dataset, known: Mapping[str, Any]) -> tuple[float, float, int] | None:
    """Return begin and end [s] of the longest swing between both limits, and its reversals."""
    t, limit, begin = recording["time"].values, _limit(known) * (1.0 - 1e-9), None
    for name in ("i_1_ref", "i_2_ref"):
        current = recording[name].values
        rows = np.flatnonzero(np.abs(current) >= limit)
        reversals = t[rows[1:]][np.diff(np.sign(current[rows])) != 0]
        for chain in np.split(reversals, np.flatnonzero(np.diff(reversals) > _LONG) + 1):
            if chain.size >= max(_SWINGS, 0 if begin is None else begin[2] + 1):
                begin = float(chain[0]), float(chain[-1]), int(chain.size)
    return begin


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
