"""Pedal tracking: the pressure follows the rider's pedal (Dardanelli 2010, Fig. 7b)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis import effort, occupation, tracking
from bywire.bench.kpis.families import FamilyJudge, units_of
from bywire.brakes.motorcycle.case import case_from_rest, smoothing
from bywire.brakes.motorcycle.parameters import DriveMode, MotorcycleParameters
from bywire.control import pedal_map
from bywire.core.errors import FileError, ParameterError, quoted
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import TimeConstant
from bywire.core.units import shown
from bywire.data.measurement import read_trace, trace_names
from bywire.plant import pedal

if TYPE_CHECKING:
    import xarray as xr

_COLUMNS = {"pressure": "Pa", "force": "N", "pedal": "m"}  # of a trace, by preference
# Built-in ride (our choice): pedal travel [mm] over time [s]. Three increasingly fast pulls, a
# modulated one, and a hold. The pedal map turns them into 5 to 30 bar, the range of Fig. 7b.
_TIMES = (0.0, 0.5, 0.9, 1.6, 2.0, 2.5, 2.7, 3.3, 3.6, 4.2, 4.3, 4.8, 5.0, 5.3, 5.6, 5.9, 6.5, 7.5)
_TRAVELS = (9, 9, 26, 26, 12, 12, 33, 33, 16, 16, 36, 36, 30, 37, 31, 37, 12, 12)


class Options(ParameterSet):
    """The ride."""

    trace: str
    """measurement file with time and pedal, force or pressure; leave empty for the built-in ride"""
    trace_map: str
    """mapping file for pedal, force or pressure; empty if the columns have these names"""
    max_gap: TimeConstant
    """maximum gap in the file that bywire interpolates linearly"""
    smoothing: TimeConstant
    """moving average for the tracking KPIs; default: one dither period; 0: raw signals"""


def cases(par: MotorcycleParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run, which starts at rest at the first sample's pressure."""
    ride = _ride(par, options)
    t = ride["time"].values - float(ride["time"][0])
    mode: DriveMode = "pressure" if "pressure" in ride else "pedal"
    signal = "p_set" if mode == "pressure" else "pedal_force"
    values = ride["pressure" if "pressure" in ride else "force"].values

    def stimulus(at: NDArray[np.float64]) -> Mapping[str, NDArray[np.float64]]:
        return {signal: np.interp(at, t, values)}

    start = float(values[0]) if mode == "pressure" else _set_point(float(values[0]), par)
    return (case_from_rest("run", par, mode, start, stimulus, float(t[-1]), settle=1.0, keep=0.0),)


def followed(options: Options) -> tracking.Setting:
    """Return the pressure and the set point that it tracks."""
    return tracking.Setting("p_mc", "p_ref", options.smoothing)


def judged(options: Options) -> dict[str, Any]:
    """Return the families of key figures: tracking of the pressure, effort, utilization."""
    return {
        "tracking": followed(options),
        "effort": effort.Setting(),
        "occupation": occupation.Setting(),
    }


def _ride(par: MotorcycleParameters, options: Options) -> xr.Dataset:
    """Return the ride with a variable ``force`` [N], or ``pressure`` [Pa] if present."""
    if not options.trace:
        import xarray as xr  # slow to load, like SciPy
        from scipy.interpolate import PchipInterpolator

        times = np.arange(0.0, _TIMES[-1], 1e-2)
        travel = PchipInterpolator(_TIMES, np.array(_TRAVELS) * 1e-3)(times)
        ride = xr.Dataset({"pedal": ("time", travel)}, coords={"time": times})
    else:
        meaning = options.trace_map or None
        names = [name.casefold() for name in trace_names(options.trace, meaning)]
        chosen = next((name for name in _COLUMNS if name in names), None)
        if chosen is None:
            raise FileError(
                f"{options.trace}: none of its columns {quoted(', '.join(names))} is pedal [mm], "
                "force [N] or pressure [bar]. Rename the column that the brake should follow, or "
                "add it to a mapping file (options.trace_map)",
                name="options.trace",
                value=quoted(", ".join(names)),
                valid="pedal [mm], force [N] or pressure [bar]",
            )
        longest = max(options.max_gap, 1e-9)
        ride = read_trace(
            options.trace, {chosen: _COLUMNS[chosen]}, max_gap=longest, mapping=meaning
        )
    _require_within_stop(ride, par, options.trace or "the built-in ride")
    if "pedal" not in ride:
        return ride
    return ride.assign(force=pedal.force_at(ride["pedal"], par.pedal))  # type: ignore[arg-type]


def _require_within_stop(ride: xr.Dataset, par: MotorcycleParameters, source: str) -> None:
    """Reject a ride that exceeds the pedal's stop."""
    x_max = par.pedal.x_max
    limits = {"pedal": (x_max, "m"), "force": (pedal.force_at(x_max, par.pedal), "N")}
    for name, (limit, unit) in limits.items():
        largest = float(ride[name].max()) if name in ride else 0.0
        if largest > limit * (1.0 + 1e-9):
            raise ParameterError(
                f"{source}: {name} reaches {shown(largest, unit)}, but the pedal stop is at "
                f"{shown(limit, unit)} (pedal.x_max = {shown(x_max, 'm')}). Change one of them",
                name=name,
                value=shown(largest, unit),
                valid=shown(limit, unit),
            )


def _set_point(force: float, par: MotorcycleParameters) -> float:
    voltage = pedal.output(pedal.Input(force=force), par.pedal).V
    return pedal_map.output(voltage, par.ecu.pedal_map)


EXPERIMENT = Experiment(
    name="pedal-tracking",
    assembly="motorcycle-brake",
    summary="pressure follows a built-in or measured trace of the rider's pedal (Fig. 7b of "
    "Dardanelli et al.)",
    options=Options,
    defaults=Options(trace="", trace_map="", max_gap=0.1, smoothing=0.02),
    cases=cases,
    judge=FamilyJudge(judged),
    kpis=units_of("tracking", "effort", "occupation", resolved={"level": "Pa"}),
    figures=("tracking", "time-traces"),
    followed=followed,
    following=smoothing,
)
