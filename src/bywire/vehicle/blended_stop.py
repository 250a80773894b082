"""Stop with regeneration, as an experiment of any vehicle with a motor at a braked wheel."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import reduce
from operator import getitem
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from pydantic import Field

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.bench.kpis.vehicle_stop import standstill
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant, Unit
from bywire.core.typing import Array
from bywire.plant.road import Gradient, SurfaceName
from bywire.vehicle import regeneration
from bywire.vehicle.ideal_stop import RidingSpeed, ideal_recovery
from bywire.vehicle.surfaces import laid

if TYPE_CHECKING:
    import xarray as xr

TorqueDemand = Annotated[float, Unit("N*m", 300.0), Field(gt=0, allow_inf_nan=False)]
CoastTorque = Annotated[float, Unit("N*m", 50.0), Field(ge=0, allow_inf_nan=False)]
Charged = Annotated[float, Unit("1", 0.5), Field(ge=0, le=1, allow_inf_nan=False)]
_CALM = 0.5  # s after the ramp, in which the brakes build up their torque
_SLOW = 1.0 / 3.6  # m/s, below which the tire rocks the wheel
_STEADY = 0.01  # change of the motor's torque within this time, relative to the demand

FIGURES = Figures(
    undefined="the vehicle does not stop within the recording. Increase options.duration",
    stopping_distance=("m", "Distance from the demand to the first standstill."),
    recovered_energy=("J", "Energy at the terminals of the battery until the stop."),
    recovered_share=("%", "Recovered energy relative to the kinetic energy."),
    recovery_efficiency=(
        "%",
        "Recovered energy relative to that of a stop without delay, with the same limits.",
    ),
    motor_share=("%", "Energy at the motor relative to the energy at motor and friction brake."),
    largest_dip=(
        "%",
        f"Maximum shortfall of the braking torque, relative to the demand, from {_CALM:g} s after "
        "its ramp, at speeds above 1 km/h, while slip control is not active.",
    ),
    steady_error=(
        "%",
        "Maximum deviation of the braking torque from the demand in the same time, where the "
        f"motor torque changes by at most {100 * _STEADY:g} % of the demand within {_CALM:g} s "
        "before and after.",
    ),
    peak_slip=("1", "Maximum slip at speeds above 2.5 m/s."),
    charge=("1", "State of charge at the stop."),
)


class BlendedStopOptions(ParameterSet):
    """The stop, the road, and the battery."""

    v_0: RidingSpeed
    """initial speed"""
    T_demand: TorqueDemand
    """torque that the pedal demands"""
    T_coast: CoastTorque
    """torque that the released accelerator demands, from before the start"""
    t_ramp: TimeConstant
    """time in which the pedal's demand rises"""
    soc: Charged
    """initial state of charge"""
    surface: SurfaceName
    """road surface"""
    gradient: Gradient
    """rise over run, uphill positive"""
    duration: Duration
    """recording time"""


@dataclass(frozen=True)
class Blended:
    """A vehicle in this experiment.

    Parameters
    ----------
    model
        Class of the assembly.
    start
        ``start(v, par, soc)``: state and memory that roll at a speed [m/s] with a battery's charge.
    friction
        Recorded torque of the friction brake at the motor's wheel.
    kinetic
        Recorded energies whose sum is the kinetic energy.
    brake
        Recorded energy that the friction brake takes from the wheel.
    v, place, slip
        Recorded speed, distance and slip.
    acts
        Recorded activity of slip control; empty without slip control.
    demand
        Stimulus of the pedal.
    unit
        ``unit(par)``: value of this stimulus per N m.
    road
        Place of the road's parameters.
    radius
        Place of the radius of the motor's wheel among the parameters.
    changes
        Parameters that the experiment sets.
    """

    model: type[Any]
    start: Callable[[float, Any, float], tuple[Any, Any]]
    friction: str
    kinetic: tuple[str, ...]
    brake: str = "E_brake"
    v: str = "v_x"
    place: str = "s"
    slip: str = "slip"
    acts: str = ""
    demand: str = "T_demand"
    unit: Callable[[Any], float] = lambda par: 1.0
    road: str = "corner.road"
    radius: str = "corner.r"
    changes: Mapping[str, Any] = field(default_factory=dict)


def demanded(t: Array, options: BlendedStopOptions) -> Array:
    """Return the pedal's demand at times [s], in N m."""
    ramp = max(options.t_ramp, 1e-9)
    return options.T_demand * np.clip((t + 1e-9) / ramp, 0.0, 1.0)


def blended_stop(name: str, vehicle: Blended, defaults: Mapping[str, Any]) -> Experiment:
    """Return the experiment of a vehicle.

    Parameters
    ----------
    name
        Name of the experiment.
    defaults
        Defaults of the options, in addition to those that suit any vehicle.
    """

    def cases(par: Any, options: BlendedStopOptions, _: object = None) -> tuple[Case, ...]:
        slope = dict.fromkeys(
            (f"{vehicle.road}.gradient", f"{vehicle.road}.gradient_further"), options.gradient
        )
        changed = par.replace({**vehicle.changes, **laid(vehicle.road, options.surface), **slope})

        per_torque = vehicle.unit(changed)

        def start(par: Any) -> tuple[Any, Any]:
            return vehicle.start(options.v_0, par, options.soc)

        def stimulus(t: Array) -> dict[str, Array]:
            coast = np.full_like(t, options.T_coast)
            return {vehicle.demand: per_torque * demanded(t, options), "T_coast": coast}

        return (
            Case(
                "run",
                vehicle.model(),
                changed,
                *start(changed),
                stimulus,
                options.duration,
                start=start,
            ),
        )

    return Experiment(
        name=name,
        assembly=vehicle.model.name,
        summary="stop from {v_0:km/h} with {T_demand}, split between motor and friction brake",
        options=BlendedStopOptions,
        defaults=BlendedStopOptions(
            **{
                "v_0": 100.0 / 3.6,
                "T_demand": 360.0,
                "T_coast": 0.0,
                "t_ramp": 0.3,
                "soc": 0.5,
                "surface": "dry-asphalt",
                "gradient": 0.0,
                "duration": 12.0,
                **defaults,
            }
        ),
        cases=cases,
        judge=lambda recordings, options: _judge(recordings["run"], options, vehicle),
        kpis=FIGURES.units,
        figures=("time-traces", "energy-balance"),
    )


def _judge(run: xr.Dataset, options: BlendedStopOptions, vehicle: Blended) -> tuple[Kpi, ...]:
    """Return the key figures of the stop."""
    t, v = run["time"].values, run[vehicle.v].values
    end = standstill(t, v)
    if math.isnan(end):
        return FIGURES(**dict.fromkeys(FIGURES.units, math.nan))

    def at_stop(name: str) -> float:
        return float(np.interp(end, t, run[name].values) - np.interp(0.0, t, run[name].values))

    kinetic = -sum(at_stop(name) for name in vehicle.kinetic)
    recovered = at_stop("E_recovered")
    motor = recovered + at_stop("E_drive")
    whole = options.T_demand + options.T_coast
    par = json.loads(run.attrs["parameters"])
    r = reduce(getitem, vehicle.radius.split("."), par)
    limits = regeneration.Parameters.model_validate(par["regeneration"])
    ideal = ideal_recovery(options.v_0, whole, r, limits, options.soc)
    nothing = (math.nan, "motor and battery accept no power")
    taken = motor + at_stop(vehicle.brake)
    fast = (t >= 0.0) & (v > 2.5)
    return FIGURES(
        stopping_distance=at_stop(vehicle.place),
        recovered_energy=recovered,
        recovered_share=100.0 * recovered / kinetic,
        recovery_efficiency=100.0 * recovered / (ideal * kinetic) if ideal > 0.0 else nothing,
        motor_share=100.0 * motor / taken,
        peak_slip=float(np.max(run[vehicle.slip].values[fast], initial=0.0)),
        charge=float(np.interp(end, t, run["soc"].values)),
        **_deviations(run, options, vehicle, end),
    )


def _deviations(
    run: xr.Dataset, options: BlendedStopOptions, vehicle: Blended, end: float
) -> dict[str, float | tuple[float, str]]:
    """Return dip and steady error of the braking torque."""
    t, v, motor = (run[name].values for name in ("time", vehicle.v, "T_m"))
    whole = options.T_demand + options.T_coast
    lack = demanded(t, options) + options.T_coast - motor - run[vehicle.friction].values
    judged = (t >= options.t_ramp + _CALM) & (t <= end) & (v > _SLOW)
    if vehicle.acts:
        judged &= run[vehicle.acts].values < 0.5
    if not judged.any():
        short = (math.nan, "the demand builds up, or slip control is active, until the stop")
        return {"largest_dip": short, "steady_error": short}
    half = max(round(_CALM / float(np.median(np.diff(t)))), 1)
    around = sliding_window_view(np.pad(motor, half, mode="edge"), 2 * half + 1)
    steady = judged & (np.ptp(around, axis=1) <= _STEADY * whole)
    never = (math.nan, "the motor torque changes all the time")
    return {
        "largest_dip": 100.0 * max(float(lack[judged].max()), 0.0) / whole,
        "steady_error": (
            100.0 * float(np.abs(lack[steady]).max()) / whole if steady.any() else never
        ),
    }
