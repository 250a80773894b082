"""Panic stops: the rider demands more than the road's adhesion, with or without slip control.

The same demand applies on one surface, with a whole brake by wire at the rear wheel, with
faster and faster brakes, and across a surface change.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import vehicle_stop
from bywire.bench.kpis.families import units_of
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.two_wheeler.case import JUDGE, Demand, on_surface, rolling_case, vehicle_of
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters, WholeRearParameters
from bywire.brakes.two_wheeler.rigs.whole_rear import TwoWheelerWholeRear, at_speed
from bywire.core.errors import not_valid
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Nodes, TimeConstant, Unit
from bywire.plant import adhesion, road
from bywire.plant.road import Distance, SurfaceName
from bywire.vehicle.ideal_stop import RidingSpeed
from bywire.vehicle.two_wheeler import VehicleParameters

if TYPE_CHECKING:
    import xarray as xr


class PanicOptions(ParameterSet):
    """Speed and demands, the same in every panic stop."""

    v_0: RidingSpeed
    """initial speed"""
    p_front: Demand
    """front pressure demand"""
    p_rear: Demand
    """rear pressure demand"""


def _demands(options: PanicOptions) -> dict[str, float]:
    return {"p_f_set": options.p_front, "p_r_set": options.p_rear}


def _locked_stop(v_0: float, par: VehicleParameters) -> float:
    """Return a time [s] in which locked wheels (on most roads even one) stop a vehicle."""
    road_ahead, body = par.road, par.body
    slope = road.slope(0.0, road_ahead)
    locked = adhesion.adhesion(1.0, road.surface(0.0, road_ahead), par.front_tyre)
    held = locked * slope.cosine + slope.sine
    if not held > 0.0:
        advice = (
            "because locked wheels do not stop the vehicle on this slope. Set the recording time"
        )
        raise not_valid("options.duration", "0 s", "> 0 s", advice)
    return round(v_0 / (0.7 * held * body.g) + 1.0, 1)


# --- On one surface


class StraightStopOptions(PanicOptions):
    """The stop, and the surface. Slope and controllers are parameters."""

    surface: SurfaceName
    """road surface"""
    duration: TimeConstant
    """recording time; 0 selects the stopping time of locked wheels on this surface plus a margin"""


def straight_stop(
    par: TwoWheelerParameters, options: StraightStopOptions, _: object = None
) -> tuple[Case, ...]:
    """Return the single run."""
    changes = on_surface(options.surface)
    duration = options.duration or _locked_stop(options.v_0, par.replace(changes).vehicle)
    return (rolling_case(par, options.v_0, _demands(options), duration, changes),)


STRAIGHT_STOP = Experiment(
    name="straight-stop",
    assembly="two-wheeler-by-wire",
    summary="panic stop from {v_0:km/h} with {p_front} at the front and {p_rear} at the rear, on "
    "{surface}",
    options=StraightStopOptions,
    defaults=StraightStopOptions(
        v_0=100.0 / 3.6, p_front=40e5, p_rear=40e5, surface="dry-asphalt", duration=0.0
    ),
    cases=straight_stop,
    judge=JUDGE,
    kpis=units_of("vehicle_stop"),
    figures=("road-marks", "time-traces", "energy-balance"),
)


# --- With a whole brake by wire at the rear wheel

ACTUATOR_FIGURES = Figures(
    rear_energy=("J", "Energy drawn by the rear brake until standstill."),
    rear_current=("A", "Maximum magnitude of the rear motor current until standstill."),
    rear_pressure_error=(
        "Pa",
        "Root-mean-square difference between rear demand and pressure at the pads.",
    ),
)
_ACTUATOR_SIGNALS = ("v", "E_rear_source", "rear_i", "p_r_ref", "p_r")


def whole_rear_stop(
    par: WholeRearParameters, options: StraightStopOptions, _: object = None
) -> tuple[Case, ...]:
    """Return the single run."""
    changes = {**on_surface(options.surface), "rear.actuator.drive.mode": "pressure"}
    duration = options.duration or _locked_stop(options.v_0, par.replace(changes).vehicle)
    vehicle = (TwoWheelerWholeRear, at_speed)
    return (rolling_case(par, options.v_0, _demands(options), duration, changes, vehicle=vehicle),)


def actuator_effort(run: xr.Dataset, _: StraightStopOptions) -> tuple[Kpi, ...]:
    """Return energy, current and pressure error of the rear actuator until standstill."""
    t, *signals = (run[name].values for name in ("time", *_ACTUATOR_SIGNALS))
    end = vehicle_stop.standstill(t, signals[0])
    braked = (t >= 0.0) & (t <= (end if math.isfinite(end) else math.inf))
    energy, current, p_ref, p = (each[braked] for each in signals[1:])
    return ACTUATOR_FIGURES(
        rear_energy=float(energy[-1] - energy[0]),
        rear_current=float(np.abs(current).max()),
        rear_pressure_error=float(np.sqrt(np.mean((p_ref - p) ** 2))),
    )


WHOLE_REAR_STOP = Experiment(
    name="whole-rear-stop",
    assembly="two-wheeler-whole-rear",
    summary="panic stop with the complete by-wire rear brake, {p_rear}",
    options=StraightStopOptions,
    defaults=StraightStopOptions(
        v_0=30.0, p_front=40e5, p_rear=40e5, surface="wet-asphalt", duration=0.0
    ),
    cases=whole_rear_stop,
    judge=replace(JUDGE, further=actuator_effort, further_signals=_ACTUATOR_SIGNALS),
    kpis=ACTUATOR_FIGURES.units | units_of("vehicle_stop"),
    figures=("road-marks", "time-traces", "energy-balance"),
)


# --- Brakes of different bandwidth: the benefit of faster actuators

_COMPARED = {
    "stopping_distance": "m",
    "braking_efficiency": "%",
    "peak_slip_front": "1",
    "jerk": "m/s**3",
    "locked_time_front": "s",
}


class BandwidthsOptions(PanicOptions):
    """The stop, and the natural frequencies of both pressure loops."""

    surface: SurfaceName
    """road surface"""
    f_n: Annotated[Nodes, Unit("Hz", 10.0), Field(min_length=1)]
    """natural frequencies of the pressure loops, with one run for each"""
    duration: Duration
    """recording time"""


def _label(f: float) -> str:
    return f"{f:g} Hz"


def bandwidths(
    par: TwoWheelerParameters, options: BandwidthsOptions, _: object = None
) -> tuple[Case, ...]:
    """Return one run for each frequency."""
    return tuple(
        rolling_case(
            par,
            options.v_0,
            _demands(options),
            options.duration,
            {
                "front.circuit.f_n": f,
                "rear.circuit.f_n": f,
                **on_surface(options.surface),
            },
            _label(f),
        )
        for f in options.f_n
    )


def judge_bandwidths(recordings: Recordings, options: BandwidthsOptions) -> tuple[Kpi, ...]:
    """Return the key figures that differ between the stops. Their names end in the frequency."""
    return tuple(
        Kpi(f"{kpi.name}_{f:g}Hz", kpi.value, kpi.unit, kpi.definition, kpi.note)
        for f in options.f_n
        for kpi in JUDGE({"run": recordings[_label(f)]}, options)
        if kpi.name in _COMPARED
    )


def bandwidths_units(options: BandwidthsOptions) -> dict[str, str]:
    """Return the unit of every key figure."""
    return {f"{name}_{f:g}Hz": unit for f in options.f_n for name, unit in _COMPARED.items()}


_BANDWIDTHS = BandwidthsOptions(
    v_0=30.0,
    p_front=40e5,
    p_rear=40e5,
    surface="wet-asphalt",
    f_n=(2.0, 3.0, 5.0, 10.0, 20.0, 40.0, 100.0),
    duration=7.0,
)

BANDWIDTHS = Experiment(
    name="bandwidths",
    assembly="two-wheeler-by-wire",
    summary="controlled stops from {v_0} on {surface} with pressure-loop bandwidths of {f_n}",
    options=BandwidthsOptions,
    defaults=_BANDWIDTHS,
    cases=bandwidths,
    judge=judge_bandwidths,
    kpis=bandwidths_units(_BANDWIDTHS),
    named=bandwidths_units,
    figures=("overlaid-traces",),
    compared={
        "v": "speed",
        "a": "deceleration",
        "slip_f": "front slip",
        "p_f": "front pressure",
    },
)


# --- Across a surface change

_CALM = 1.2  # relative to the peak slip

JUMP_FIGURES = Figures(
    recovery_time=(
        "s",
        "Time from the front wheel's entry onto the second surface until its slip stays below "
        f"{_CALM:g} times that surface's peak slip, at speeds above {vehicle_stop.SLOW:g} m/s.",
    ),
    jump_speed=("m/s", "Speed at the surface change."),
)


class SurfaceJumpOptions(PanicOptions):
    """The stop, and the two surfaces."""

    first: SurfaceName
    """surface at the start"""
    further: SurfaceName
    """surface after x_change"""
    x_change: Distance
    """position at which the second surface begins"""
    duration: Duration
    """recording time"""


def surface_jump(
    par: TwoWheelerParameters, options: SurfaceJumpOptions, _: object = None
) -> tuple[Case, ...]:
    """Return the single run."""
    changes = {
        **on_surface(options.first, options.further),
        "vehicle.road.x_change": options.x_change,
        "vehicle.road.x_back": options.x_change + 1e6,
    }
    return (rolling_case(par, options.v_0, _demands(options), options.duration, changes),)


def recovery(run: xr.Dataset, options: SurfaceJumpOptions) -> tuple[Kpi, ...]:
    """Return the front wheel's recovery on the second surface."""
    t, x, v = (run[name].values for name in ("time", "x", "v"))
    if not np.any(x > options.x_change):
        undefined = (math.nan, "the vehicle stops before the second surface")
        return JUMP_FIGURES(recovery_time=undefined, jump_speed=undefined)
    k = int(np.argmax(x > options.x_change))
    begin = float(np.interp(options.x_change, x[: k + 1], t[: k + 1]))
    ground = road.surface(options.x_change + 1.0, vehicle_of(run).road)
    beyond = (t > begin) & (v > vehicle_stop.SLOW)
    peak = adhesion.peak_slip(ground, vehicle_of(run).front_tyre)
    beyond &= run["slip_f"].values > _CALM * peak
    last = float(t[np.flatnonzero(beyond)[-1]]) if beyond.any() else begin
    return JUMP_FIGURES(recovery_time=last - begin, jump_speed=float(np.interp(begin, t, v)))


SURFACE_JUMP = Experiment(
    name="surface-jump",
    assembly="two-wheeler-by-wire",
    summary="panic stop from {v_0}, with a change from {first} to {further} after {x_change:m}",
    options=SurfaceJumpOptions,
    defaults=SurfaceJumpOptions(
        v_0=30.0,
        p_front=40e5,
        p_rear=40e5,
        first="dry-asphalt",
        further="wet-asphalt",
        x_change=15.0,
        duration=6.0,
    ),
    cases=surface_jump,
    judge=replace(JUDGE, further=recovery, further_signals=("x", "v", "slip_f")),
    kpis=JUMP_FIGURES.units | units_of("vehicle_stop"),
    figures=("road-marks", "time-traces", "energy-balance"),
)
