"""Corner panic: more moment is demanded of the wedge brake than the road holds."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.bench.kpis.vehicle_stop import SLOW, standstill
from bywire.brakes.wedge.case import steps
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.rigs.wedge_corner import WedgeCorner, WedgeCornerParameters, at_speed
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Temperature
from bywire.plant import adhesion, road
from bywire.plant.road import SurfaceName
from bywire.vehicle.ideal_stop import RidingSpeed
from bywire.vehicle.surfaces import laid

FIGURES = Figures(
    undefined="the vehicle does not stop in the recorded time: give a longer options.duration",
    stopping_distance=("m", "Distance from the demand to the first standstill."),
    stopping_time=("s", "Time from the demand to the first standstill."),
    braking_efficiency=("%", "Ideal stopping distance on this road over the distance."),
    first_bite=("s", "Time from the demand until the pads touch."),
    peak_slip=("1", f"Largest slip above {SLOW:g} m/s."),
    locked_time=("s", f"Time in which the wheel stands, above {SLOW:g} m/s."),
    peak_moment=("N*m", "Largest moment of the brake."),
    supply_energy=("J", "Energy that the drives take until the stop."),
    disc_energy=("J", "Energy taken from the wheel until the stop."),
    disc_temperature=("K", "Highest temperature of the disc until the stop."),
)


class Options(ParameterSet):
    """The stop; slip control is a parameter, ``ecu.abs``."""

    v_0: RidingSpeed
    """speed at the start"""
    M_brake: SomeMoment
    """moment demanded from time zero on"""
    surface: SurfaceName
    """what the road is made of"""
    T_disc: Temperature
    """temperature of the disc at the start, where heat counts (corner.heat.law)"""
    duration: Duration
    """time recorded"""


def cases(par: WedgeCornerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    given = {"command.mode": "moment", "flywheel.law": "coasting"}
    changed = par.replace(given | laid("corner.road", options.surface))
    state, memory = at_speed(options.v_0, changed, options.T_disc)
    levels = {0.0: options.M_brake}
    return (
        Case(
            "run",
            WedgeCorner(),
            changed,
            state,
            memory,
            lambda t: {"M_set": steps(t, levels)},
            options.duration,
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
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
    return FIGURES(**figures, **_at_the_end(run, end, options.v_0))


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
        "braking_efficiency": 100.0 * _ideal(v_0, par) / distance,
        "supply_energy": spent("W_supply"),
        "disc_energy": spent("E_brake"),
    }


def _ideal(v_0: float, par: WedgeCornerParameters) -> float:
    """Return the shortest stopping distance [m]: the tyre at its peak from the demand on."""
    corner = par.corner
    ground, slope = road.surface(0.0, corner.road), road.slope(0.0, corner.road)
    mu = adhesion.adhesion(adhesion.peak_slip(ground, corner.tyre), ground, corner.tyre)
    a = corner.body.g * (mu * slope.cosine + slope.sine)
    return v_0 * v_0 / (2.0 * a) if a > 0 else math.inf


EXPERIMENT = Experiment(
    name="corner-panic",
    assembly="wedge-corner",
    summary="the wedge brake stops a quarter of a car from {v_0:km/h} on {surface} by slip control",
    options=Options,
    defaults=Options(
        v_0=100.0 / 3.6, M_brake=1500.0, surface="wet-asphalt", T_disc=293.15, duration=5.0
    ),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
