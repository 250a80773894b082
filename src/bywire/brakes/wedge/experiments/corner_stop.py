"""Corner stop: the wedge brake stops a quarter of a car, holds it, and lets go.

The moment is demanded until the vehicle stands and beyond. What the tyre does to the brake at the
end is the subject: it rocks back, and the wheel with it as far as the pads let it.
"""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.bench.kpis.vehicle_stop import standstill
from bywire.brakes.wedge.case import mean, steps, swing
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.rigs.wedge_corner import WedgeCorner, WedgeCornerParameters, at_speed
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Temperature
from bywire.plant.road import SurfaceName
from bywire.vehicle.ideal_stop import RidingSpeed
from bywire.vehicle.surfaces import laid

_CALM = 1.0  # s from the stop on, in which tyre and brake come to rest

FIGURES = Figures(
    undefined="the vehicle does not stop before the brake lets go",
    stopping_distance=("m", "Distance from the demand to the first standstill."),
    stopping_time=("s", "Time from the demand to the first standstill."),
    moment_before_stop=("N*m", "Mean moment of the sensor in the last half second of braking."),
    peak_slip=("1", "Largest slip above a tenth of the speed at the start."),
    rebound_speed=("m/s", "Largest speed backward after the stop."),
    wheel_reversal=("rad", "How far the wheel turns back after the stop."),
    force_held=("N", f"Mean normal force from {_CALM:g} s after the stop to the release."),
    force_change=("N", "Normal force peak to peak in that time."),
    creep_speed=("m/s", "Largest speed of the vehicle in that time."),
    energy_braked=("J", "Energy taken from the wheel until the stop."),
    disc_temperature=("K", "Temperature of the disc at the stop."),
    contact_angle=("rad", "Where the moment control believes the pads to touch, from parking."),
)


class Options(ParameterSet):
    """The stop."""

    v_0: RidingSpeed
    """speed at the start"""
    M_brake: SomeMoment
    """moment demanded from time zero on"""
    surface: SurfaceName
    """what the road is made of"""
    T_disc: Temperature
    """temperature of the disc at the start, where heat counts (corner.heat.law)"""
    t_hold: Duration
    """time until the demand falls to zero"""
    t_end: Duration
    """time recorded after it"""


def cases(par: WedgeCornerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    given = {"command.mode": "moment", "flywheel.law": "coasting", "ecu.abs": "off"}
    changed = par.replace(given | laid("corner.road", options.surface))
    state, memory = at_speed(options.v_0, changed, options.T_disc)
    levels = {0.0: options.M_brake, options.t_hold: 0.0}
    return (
        Case(
            "run",
            WedgeCorner(),
            changed,
            state,
            memory,
            lambda t: {"M_set": steps(t, levels)},
            options.t_hold + options.t_end,
            start=lambda par: at_speed(options.v_0, par, options.T_disc),
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return how the corner stops, and what is held then."""
    run = recordings["run"]
    held = run.sel(time=slice(None, options.t_hold - 1e-9))
    end = standstill(held["time"].values, held["v_x"].values)
    if math.isnan(end):
        return FIGURES(**dict.fromkeys(FIGURES.units, math.nan))
    return FIGURES(**_stop(held, end, options))


def _stop(held: xr.Dataset, end: float, options: Options) -> dict[str, float | tuple[float, str]]:
    t, v = held["time"].values, held["v_x"].values
    begin, last = end + _CALM, options.t_hold
    late = t >= begin
    fast = v > 0.1 * options.v_0
    short = (math.nan, f"less than {_CALM:g} s are held after the stop")
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


EXPERIMENT = Experiment(
    name="corner-stop",
    assembly="wedge-corner",
    summary="the wedge brake stops a quarter of a car from {v_0:km/h} with {M_brake}, and holds it",
    options=Options,
    defaults=Options(
        v_0=50.0 / 3.6, M_brake=600.0, surface="dry-asphalt", T_disc=293.15, t_hold=5.5, t_end=0.5
    ),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
