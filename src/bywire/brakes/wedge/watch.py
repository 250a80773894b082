"""Warnings about a recording of the wedge brake: end stops, limits, self-locking screws."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.brakes.wedge.laws.moment_control import MOMENT
from bywire.core.parameters import ParameterSet
from bywire.core.units import shown

if TYPE_CHECKING:
    import xarray as xr

Rows = NDArray[np.bool_]

_REACHED = 0.95  # fraction of the demanded moment that is treated as reached
_LONG = 0.05  # time [s] at the current limit after which a moment is treated as out of reach
_SWINGS = 10  # reversals between current limits, at most _LONG apart; a step has fewer


def warnings_of(recording: xr.Dataset, par: ParameterSet) -> list[str]:
    """Return the warnings about a recording with rows, none without the brake's signals."""
    values = par.flat()
    if not {"F_end", "M_set", "i_1_ref", "i_2_ref"} <= set(recording):
        return []
    warnings = _end_stop(recording)
    if values["command.mode"] == "moment":  # in other modes the test demands the currents
        warnings += _out_of_reach(recording, values) or _not_reached(recording, values)
        warnings += _limits(recording, values)
    return warnings + _holding_screw(recording, values)


def _end_stop(recording: xr.Dataset) -> list[str]:
    force = np.abs(recording["F_end"].values)
    if not force.any():
        return []
    k = int(np.argmax(force > 0))
    when, x = _when(recording, k), 1e3 * float(recording["x"].values[k])
    return [
        f"the wedge reached its end stop {when}, x = {x:.3g} mm, and pressed on it with "
        f"up to {force.max():.3g} N. The stop limits the braking moment"
    ]


def _when(recording: xr.Dataset, k: int) -> str:
    """Return the time of row ``k`` in words. An event in the first row began earlier."""
    t = float(recording["time"].values[k])
    return "before the recording starts" if k == 0 else f"at t = {t:.4g} s"


def _limit(values: Mapping[str, Any]) -> float:
    return float(min(values["control.position.i_max"], values["drive.i_max"]))


def _limited(recording: xr.Dataset, values: Mapping[str, Any]) -> Rows:
    """Return the rows in which a motor's demanded current is at its limit."""
    refs = [np.abs(recording[name].values) for name in ("i_1_ref", "i_2_ref")]
    return np.asarray(np.maximum(*refs) >= _limit(values) * (1.0 - 1e-9))


def _out_of_reach(recording: xr.Dataset, values: Mapping[str, Any]) -> list[str]:
    """Warn that the current limit keeps the demanded moment out of reach."""
    begin, end = _longest(_short_of(recording, values) & _limited(recording, values))
    t, demand = recording["time"].values, recording["M_set"].values
    demanded = float(demand[begin : end + 1].max())
    moment = np.abs(recording["M_B"].values)
    most = float(moment[demand >= _REACHED * demanded].max())
    if t[end] - t[begin] < _LONG or most >= _REACHED * demanded or _swings(recording, values):
        return []
    return [
        f"the motors cannot reach the demanded {demanded:.4g} N*m. At the current limit of "
        f"{_limit(values):.4g} A, from t = {t[begin]:.4g} s to {t[end]:.4g} s, the maximum moment "
        f"is {most:.4g} N*m"
    ]


def _not_reached(recording: xr.Dataset, values: Mapping[str, Any]) -> list[str]:
    """Warn that the moment never reached the maximum demand, for any reason."""
    demanded = float(recording["M_set"].values.max())
    most = float(np.abs(recording["M_B"].values).max())
    sparse = np.diff(recording["time"].values).max(initial=0.0) > _LONG  # may miss the peak
    if sparse or most >= _REACHED * demanded:
        return []
    text = (
        f"the brake did not reach the demand of {demanded:.4g} N*m. The maximum moment is "
        f"{most:.4g} N*m"
    )
    M_on, speed = values["control.moment.M_on"], np.abs(recording["Omega"].values).max()
    if demanded <= M_on:
        text += f", because the brake stays parked up to control.moment.M_on = {M_on:.4g} N*m"
    elif speed < values["control.moment.Omega_still"]:
        text += ", because the disc is at rest"
    return [text]


def _limits(recording: xr.Dataset, values: Mapping[str, Any]) -> list[str]:
    """Warn about a briefly reached current limit, or currents that swing between limits."""
    limited, limit = _limited(recording, values), _limit(values)
    if not limited.any() or _out_of_reach(recording, values):
        return []
    swings = _swings(recording, values)
    if swings:
        begin, end, number = swings
        return [
            f"the demanded current swings between its limits of -{limit:.4g} A and {limit:.4g} A, "
            f"{number} times from t = {begin:.4g} s to {end:.4g} s. A loop is probably unstable "
            "(see 'bywire margins position' and 'bywire margins moment')"
        ]
    k = int(np.argmax(limited))
    return [f"the current limit of {limit:.4g} A was reached {_when(recording, k)}"]


def _swings(recording: xr.Dataset, values: Mapping[str, Any]) -> tuple[float, float, int] | None:
    """Return start and end [s] of the longest swing between both limits, and its reversals."""
    t, limit, begin = recording["time"].values, _limit(values) * (1.0 - 1e-9), None
    for name in ("i_1_ref", "i_2_ref"):
        current = recording[name].values
        rows = np.flatnonzero(np.abs(current) >= limit)
        reversals = t[rows[1:]][np.diff(np.sign(current[rows])) != 0]
        for chain in np.split(reversals, np.flatnonzero(np.diff(reversals) > _LONG) + 1):
            if chain.size >= max(_SWINGS, 0 if begin is None else begin[2] + 1):
                begin = float(chain[0]), float(chain[-1]), int(chain.size)
    return begin


def _short_of(recording: xr.Dataset, values: Mapping[str, Any]) -> Rows:
    """Return the rows with moment control on a turning disc and a moment below the demand."""
    turning = np.abs(recording["Omega"].values) > values["control.moment.Omega_still"]
    demanded = _REACHED * recording["M_set"].values
    below = np.abs(recording["y_M"].values) < demanded
    return np.asarray((recording["mode"].values == MOMENT) & turning & below)


def _longest(rows: Rows) -> tuple[int, int]:
    """Return first and last index of the longest stretch of rows, (0, 0) without any."""
    edges = np.flatnonzero(np.diff(rows.astype(np.int8), prepend=0, append=0))
    if not edges.size:
        return 0, 0
    begins, ends = edges[::2], edges[1::2] - 1
    k = int(np.argmax(ends - begins))
    return int(begins[k]), int(ends[k])


def _holding_screw(recording: xr.Dataset, values: Mapping[str, Any]) -> list[str]:
    """Warn that the screws lock themselves, and that the motors cannot release them."""
    eta_b = values["screw.eta_b"]
    if values["screw.law"] != "load" or eta_b > 0.0:
        return []
    locked = f"screw.eta_b = {eta_b:g}: no load can drive these screws back"
    force = max(float(np.abs(recording[name].values).max()) for name in ("f_1", "f_2"))
    needed = -eta_b * force * values["screw.lead"] / (2.0 * math.pi)
    most = _limit(values) * min(values["motor_1.K_ref"], values["motor_2.K_ref"])
    if needed > most:
        load = shown(force, "N", digits=3)
        return [
            f"{locked}, and the motors cannot release them from {load}. This takes {needed:.3g} "
            f"N*m, but the current limit of {_limit(values):.4g} A allows {most:.3g} "
            f"N*m. Use screw.eta_b >= {-most / needed * abs(eta_b):.2g}"
        ]
    return [f"{locked}, so the brake keeps its moment after power-off"]
