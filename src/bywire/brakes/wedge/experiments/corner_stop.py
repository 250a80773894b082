"""Stops of a quarter car: a stop with hold, and a panic stop that exceeds the road's adhesion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.bench.kpis.vehicle_stop import SLOW, standstill
from bywire.brakes.wedge.case import mean, steps, swing
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.rigs.wedge_corner import WedgeCorner, WedgeCornerParameters, at_speed
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Temperature
from bywire.plant.road import SurfaceName
from bywire.vehicle.ideal_stop import RidingSpeed, ideal_corner_distance
from bywire.vehicle.surfaces import laid

if TYPE_CHECKING:
    import xarray as xr


class StopOptions(ParameterSet):
    """Start, demand and road of both stops."""

    v_0: RidingSpeed
    """initial speed"""
    M_brake: SomeMoment
    """moment demand from time zero"""
    surface: SurfaceName
    """road surface"""
    T_disc: Temperature
    """initial disc temperature, if corner.heat.law is on"""


def _stop_case(
    par: WedgeCornerParameters,
    options: StopOptions,
    changes: Mapping[str, str],
    levels: Mapping[float, float],
    duration: float,
) -> Case:
    """Return a stop whose moment demands [N m] start at the times [s] in ``levels``."""
    overrides = {"command.mode": "moment", "flywheel.law": "coasting", **changes}
    changed = par.replace(overrides | laid("corner.road", options.surface))
    state, memory = at_speed(options.v_0, changed, options.T_disc)
    return Case(
        "run",
        WedgeCorner(),
        changed,
        state,
        memory,
        lambda t: {"M_set": steps(t, levels)},
        duration,
        start=lambda par: at_speed(options.v_0, par, options.T_disc),
    )


# --- Stop, hold and release: the tire rocks back, and the wheel too as far as the pads allow

_CALM = 1.0  # s after the stop, in which tire and brake come to rest

STOP_FIGURES = Figures(
    undefined="the vehicle does not stop before the release",
    stopping_distance=("m", "Distance from the demand to the first standstill."),
    stopping_time=("s", "Time from the demand to the first standstill."),
    moment_before_stop=("N*m", "Mean measured moment in the last half second of braking."),
    peak_slip=("1", "Maximum slip at speeds above a tenth of the initial speed."),
    rebound_speed=("m/s", "Maximum backward speed after the stop."),
    wheel_reversal=("rad", "Angle by which the wheel turns backward after the stop."),
    force_held=("N", f"Mean normal force from {_CALM:g} s after the stop to the release."),
    force_change=("N", "Peak-to-peak normal force in that time."),
    creep_speed=("m/s", "Maximum vehicle speed in that time."),
    energy_braked=("J", "Energy taken from the wheel until the stop."),
    disc_temperature=("K", "Disc temperature at the stop."),
    contact_angle=("rad", "Estimated motor angle from the parking position to pad contact."),
)


class CornerStopOptions(StopOptions):
    """The stop."""

    t_hold: Duration
    """time until the demand falls to zero"""
    t_end: Duration
    """recording time after the release"""


def corner_stop(
    par: WedgeCornerParameters, options: CornerStopOptions, _: object = None
) -> tuple[Case, ...]:
    """Return the single run."""
    levels = {0.0: options.M_brake, options.t_hold: 0.0}
    return (_stop_case(par, options, {"ecu.abs": "off"}, levels, options.t_hold + options.t_end),)


def judge_stop(recordings: Recordings, options: CornerStopOptions) -> tuple[Kpi, ...]:
    """Return the key figures of the stop and of the hold after it."""
    run = recordings["run"]
    held = run.sel(time=slice(None, options.t_hold - 1e-9))
    end = standstill(held["time"].values, held["v_x"].values)
    if math.isnan(end):
        return STOP_FIGURES(**dict.fromkeys(STOP_FIGURES.units, math.nan))
    return STOP_FIGURES(**_stop(held, end, options))


def _stop(
    held: xr.Dataset, end: float, options: CornerStopOptions
) -> dict[str, float | tuple[float, str]]:
    t, v = held["time"].values, held["v_x"].values
    begin, last = end + _CALM, options.t_hold
    late = t >= begin
    fast = v > 0.1 * options.v_0
    short = (math.nan, f"the hold after the stop is shorter than {_CALM:g} s")
    return {
        "stopping_distance": float(np.interp(end, t, held["s"].values)),
        "stopping_time": end,
        "moment_before_stop": mean(held, "y_M", max(end - 0.5, 0.0), end),
        "peak_slip": float(np.max(held["slip"].values[fast], initial=0.0)),
        "rebound_speed": float(np.max(-v[t >= end])),
        "wheel_reversal": float(np.max(held["phi"].values) - held["phi"].values[-1]),
        "force_held": mean(held, "F_N", begin, last) if late.any() else short,
        "force_change": swing(held, "F_N", begin, last) if late.any() else short,
        "creep_speed": float(np.max(np.abs(v[late]))) if late.any() else short,
        "energy_braked": float(np.interp(end, t, held["E_brake"].values)),
        "disc_temperature": float(np.interp(end, t, held["T_disc"].values)),
        "contact_angle": float(np.interp(end, t, held["theta_c"].values)),
    }


CORNER_STOP = Experiment(
    name="corner-stop",
    assembly="wedge-corner",
    summary="the wedge brake stops a quarter car from {v_0:km/h} with {M_brake} and holds it",
    options=CornerStopOptions,
    defaults=CornerStopOptions(
        v_0=50.0 / 3.6, M_brake=600.0, surface="dry-asphalt", T_disc=293.15, t_hold=5.5, t_end=0.5
    ),
    cases=corner_stop,
    judge=judge_stop,
    kpis=STOP_FIGURES.units,
    figures=("time-traces", "energy-balance"),
)


# --- Panic stop: the demand exceeds the road's adhesion

PANIC_FIGURES = Figures(
    undefined="the vehicle does not stop within the recording. Increase options.duration",
    stopping_distance=("m", "Distance from the demand to the first standstill."),
    stopping_time=("s", "Time from the demand to the first standstill."),
    braking_efficiency=("%", "Ratio of the ideal stopping distance on this road to the actual."),
    first_bite=("s", "Time from the demand until the pads touch."),
    peak_slip=("1", f"Maximum slip at speeds above {SLOW:g} m/s."),
    locked_time=("s", f"Time with a locked wheel at speeds above {SLOW:g} m/s."),
    peak_moment=("N*m", "Maximum brake moment."),
    supply_energy=("J", "Energy drawn by the drives until the stop."),
    disc_energy=("J", "Energy taken from the wheel until the stop."),
    disc_temperature=("K", "Maximum disc temperature until the stop."),
)


class CornerPanicOptions(StopOptions):
    """The stop. The parameter ``ecu.abs`` selects the slip control."""

    duration: Duration
    """recording time"""


def corner_panic(
    par: WedgeCornerParameters, options: CornerPanicOptions, _: object = None
) -> tuple[Case, ...]:
    """Return the single run."""
    return (_stop_case(par, options, {}, {0.0: options.M_brake}, options.duration),)


def judge_panic(recordings: Recordings, options: CornerPanicOptions) -> tuple[Kpi, ...]:
    """Return the key figures of the stop."""
    run = recordings["run"]
    t, v = run["time"].values, run["v_x"].values
    end = standstill(t, v)
    braked = (t >= 0) & (t <= end if math.isfinite(end) else np.isfinite(t))
    fast = braked & (v > SLOW)
    stands = fast & (run["Omega"].values == 0)
    touches = braked & (run["F_N"].values > 0)
    never = (math.nan, "the pads never touch")
    figures: dict[str, float | tuple[float, str]] = {
        "stopping_time": end,
        "first_bite": float(t[np.argmax(touches)]) if touches.any() else never,
        "peak_slip": float(np.max(run["slip"].values[fast], initial=0.0)),
        "locked_time": float(np.sum(np.diff(t)[stands[:-1]])),
        "peak_moment": float(np.max(run["M_B"].values[braked])),
        "disc_temperature": float(np.max(run["T_disc"].values[braked])),
    }
    return PANIC_FIGURES(**figures, **_at_the_end(run, end, options.v_0))


def _at_the_end(run: xr.Dataset, end: float, v_0: float) -> dict[str, float]:
    if not math.isfinite(end):
        names = ("stopping_distance", "braking_efficiency", "supply_energy", "disc_energy")
        return dict.fromkeys(names, math.nan)

    def spent(name: str) -> float:
        at = np.interp([0.0, end], run["time"].values, run[name].values)
        return float(at[1] - at[0])

    distance = spent("s")
    par = WedgeCornerParameters.model_validate_json(run.attrs["parameters"])
    return {
        "stopping_distance": distance,
        "braking_efficiency": 100.0 * ideal_corner_distance(v_0, par.corner) / distance,
        "supply_energy": spent("W_supply"),
        "disc_energy": spent("E_brake"),
    }


CORNER_PANIC = Experiment(
    name="corner-panic",
    assembly="wedge-corner",
    summary="the wedge brake stops a quarter car from {v_0:km/h} on {surface} with slip control",
    options=CornerPanicOptions,
    defaults=CornerPanicOptions(
        v_0=100.0 / 3.6, M_brake=1500.0, surface="wet-asphalt", T_disc=293.15, duration=5.0
    ),
    cases=corner_panic,
    judge=judge_panic,
    kpis=PANIC_FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
