"""Stop from a speed with a demand that locks the wheel, on any surface."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.authoring import (
    Array,
    Case,
    Duration,
    Experiment,
    Figures,
    Kpi,
    ParameterSet,
    Recordings,
    Unit,
)
from bywire.plant import road
from bywire.vehicle import RidingSpeed, ideal_corner_distance, surfaces
from one_box.rigs.corner import OneBoxCorner, OneBoxCornerParameters, rolling

Demand = Annotated[float, Unit("Pa", 1e7), Field(gt=0, allow_inf_nan=False)]
SLOW = 4.0
"""speed [m/s] below which the wheel may lock"""
_SETTLED = 0.5  # s until the first cycle is over
_NO_CYCLE = "anti-lock control does not release the wheel twice"

FIGURES = Figures(
    undefined="the vehicle does not stop within the recording. Increase options.duration",
    stopping_distance=("m", "Distance from the demand to the first standstill."),
    braking_efficiency=("%", "Ratio of the ideal stopping distance on this road to the actual."),
    stopping_time=("s", "Time from the demand to the first standstill."),
    peak_slip=("1", f"Largest slip at speeds above {SLOW:g} m/s."),
    slip_low=("1", f"Slip that 10 % of the time after {_SETTLED:g} s is below."),
    slip_high=("1", f"Slip that 10 % of the time after {_SETTLED:g} s is above."),
    locked_time=("s", f"Time with a locked wheel at speeds above {SLOW:g} m/s."),
    cycle_rate=("1/s", f"Releases of the wheel per second, after {_SETTLED:g} s."),
    pressure_low=("Pa", f"Smallest wheel pressure after {_SETTLED:g} s."),
    pressure_high=("Pa", f"Largest wheel pressure after {_SETTLED:g} s."),
    released_volume=("m**3", "Fluid released into the accumulator."),
    pumped_volume=("m**3", "Fluid that the pump returned."),
    accumulator_max=("m**3", "Largest volume in the accumulator."),
    supply_energy=("J", "Energy from the battery until the stop."),
    volume_error=("m**3", "Largest residual of the fluid volume balance."),
)


class Options(ParameterSet):
    """The stop. The parameter ``antilock.abs`` selects the slip control."""

    v_0: RidingSpeed
    """initial speed"""
    p_brake: Demand
    """pressure demand of the driver from time zero"""
    surface: road.SurfaceName
    """road surface"""
    duration: Duration
    """maximum recording time"""


def cases(par: OneBoxCornerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    ground = surfaces.laid("corner.road", options.surface)
    driven = par.replace({"drive": "pressure", **ground})
    return (
        Case(
            "run",
            OneBoxCorner(),
            driven,
            *rolling(driven, options.v_0),
            lambda t: {"p_set": np.where(t >= 0.0, options.p_brake, 0.0)},
            options.duration,
            start=lambda par: rolling(par, options.v_0),
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of the stop."""
    run = recordings["run"]
    t, v = run["time"].values, run["v_x"].values
    still = np.flatnonzero((v <= 1e-3) & (t > 0.0))
    if not still.size or not float(run["s"][still[0]]) > 0.0:
        return FIGURES(**dict.fromkeys(FIGURES.units, math.nan))
    until = int(still[0])
    stop = run.isel(time=slice(0, until + 1))
    par = OneBoxCornerParameters.model_validate_json(run.attrs["parameters"])
    distance = float(stop["s"][-1])
    return FIGURES(
        stopping_distance=distance,
        braking_efficiency=100.0 * ideal_corner_distance(options.v_0, par.corner) / distance,
        stopping_time=float(t[until]),
        **_wheel(stop),
        **_valves(stop),
    )


def _wheel(stop: xr.Dataset) -> dict[str, float]:
    """Return the figures of the wheel's slip."""
    t, v, slip = (stop[name].values for name in ("time", "v_x", "slip"))
    fast = (v > SLOW) & (t >= 0.0)
    locked = fast & (stop["omega_w"].values == 0.0)
    late = slip[fast & (t > _SETTLED)]
    low, high = np.percentile(late, (10.0, 90.0)) if late.size else (math.nan, math.nan)
    return {
        "peak_slip": float(slip[fast].max(initial=0.0)),
        "slip_low": float(low),
        "slip_high": float(high),
        "locked_time": float(np.sum(np.diff(t)[locked[:-1]])),
    }


def _valves(stop: xr.Dataset) -> dict[str, float | tuple[float, str]]:
    """Return the figures of pressure, valves, accumulator and pump."""
    t, p, lift = (stop[name].values for name in ("time", "p", "x_out"))
    late = (t > _SETTLED) & (stop["v_x"].values > SLOW)
    none = (math.nan, _NO_CYCLE)
    starts = _releases(t[late], lift[late]) if late.any() else np.zeros(0)
    is_cyclic = starts.size > 1
    released, pumped = (float(stop[name][-1]) for name in ("V_released", "V_pumped"))
    return {
        "cycle_rate": float((starts.size - 1) / (starts[-1] - starts[0])) if is_cyclic else none,
        "pressure_low": float(p[late].min()) if late.any() else none,
        "pressure_high": float(p[late].max()) if late.any() else none,
        "released_volume": released,
        "pumped_volume": pumped,
        "accumulator_max": float(stop["V_acc"].max()),
        "supply_energy": float(stop["E_source"][-1] - stop["E_source"][0]),
        "volume_error": float(abs(stop["V_missing"]).max()),
    }


def _releases(t: Array, lift: Array) -> Array:
    """Return the times at which the outlet valve opens after it was closed for a tenth of a second.

    Short pulses of one release count once.
    """
    opened = lift > 0.5 * lift.max(initial=0.0)
    times = t[np.flatnonzero(opened[1:] & ~opened[:-1]) + 1] if lift.size else np.zeros(0)
    starts: list[float] = []
    for time in times.tolist():
        if not starts or time - starts[-1] > 0.03:
            starts.append(time)
    return np.array(starts)


EXPERIMENT = Experiment(
    name="abs-stop",
    assembly="one-box-corner",
    summary="stop from {v_0:km/h} on {surface} with a demand of {p_brake:bar}",
    options=Options,
    defaults=Options(v_0=100.0 / 3.6, p_brake=120e5, surface="wet-asphalt", duration=6.0),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "slip-cycle", "energy-balance"),
)
