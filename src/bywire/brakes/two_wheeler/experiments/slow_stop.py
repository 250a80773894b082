"""Stops from walking pace, held until the end of the run, or held on a slope and released."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import vehicle_stop
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.two_wheeler.case import Course, Demand, rolling_case, vehicle_of
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.errors import not_valid
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.plant import road, two_wheeler_body
from bywire.plant.road import Gradient
from bywire.vehicle.ideal_stop import RidingSpeed
from bywire.vehicle.two_wheeler import VehicleParameters

if TYPE_CHECKING:
    import xarray as xr

_CALM = 2.0  # s after the stop


class WalkingPaceOptions(ParameterSet):
    """Speed, demands and slope of both stops."""

    v_0: RidingSpeed
    """initial speed"""
    p_front: Demand
    """front pressure demand"""
    p_rear: Demand
    """rear pressure demand"""
    gradient: Gradient
    """rise over run, uphill positive"""


def _uncontrolled(gradient: float) -> dict[str, float | str]:
    """Return the parameters of a sloped road, and of an ECU without slip and lift control."""
    return {
        "vehicle.road.gradient": gradient,
        "vehicle.road.gradient_further": gradient,
        "ecu.abs": "off",
        "ecu.lift": "off",
        "ecu.p_rate": 1e12,  # the rider's hand is as fast as the circuit
    }


# --- Held until the end

_QUIET = 1e-3  # m/s

SLOW_FIGURES = Figures(
    undefined="the vehicle does not stop within the recording",
    stopping_distance=("m", "Distance from t = 0 to the first standstill."),
    stopping_time=("s", "Time until the first standstill."),
    rebound_speed=(
        "m/s",
        "Maximum backward speed after the standstill, from the tires' elasticity.",
    ),
    rollback=("m", "Distance from the farthest position to the final position."),
    ringing_time=("s", f"Time from the standstill until the speed stays below {_QUIET:g} m/s."),
    creep_speed=("m/s", f"Maximum speed from {_CALM:g} s after the first standstill on."),
    creep=("m", "Distance in that time."),
)


class SlowStopOptions(WalkingPaceOptions):
    """The stop, and the slope. Slip and lift control are off."""

    duration: Duration
    """recording time"""


def slow_stop(
    par: TwoWheelerParameters, options: SlowStopOptions, _: object = None
) -> tuple[Case, ...]:
    """Return the single run."""
    demands = {"p_f_set": options.p_front, "p_r_set": options.p_rear}
    changes = _uncontrolled(options.gradient)
    return (rolling_case(par, options.v_0, demands, options.duration, changes),)


def judge_slow_stop(recordings: Recordings, _: SlowStopOptions) -> tuple[Kpi, ...]:
    """Return rebound, ringing and creep of the vehicle."""
    run = recordings["run"]
    end = vehicle_stop.standstill(run["time"].values, run["v"].values)
    if math.isnan(end):
        return SLOW_FIGURES(**dict.fromkeys(SLOW_FIGURES.units, math.nan))
    return SLOW_FIGURES(**_rest(run, end))


def _rest(run: xr.Dataset, end: float) -> dict[str, float | tuple[float, str]]:
    t, x, v = (run[name].values for name in ("time", "x", "v"))
    after = t >= end
    loud = np.flatnonzero(np.abs(v) > _QUIET)[-1]
    rings = (
        float(t[loud]) - end
        if loud + 1 < t.size
        else (math.nan, "the vehicle does not come to rest")
    )
    late = t >= end + _CALM
    short = (math.nan, f"the recording ends less than {_CALM:g} s after the stop")
    return {
        "stopping_distance": float(np.interp(end, t, x)),
        "stopping_time": end,
        "rebound_speed": float(np.max(-v[after])),
        "rollback": float(np.max(x) - x[-1]),
        "ringing_time": rings,
        "creep_speed": float(np.max(np.abs(v[late]))) if late.any() else short,
        "creep": float(np.ptp(x[late])) if late.any() else short,
    }


SLOW_STOP = Experiment(
    name="slow-stop",
    assembly="two-wheeler-by-wire",
    summary="stop from {v_0} without control, then held on a level road or a slope",
    options=SlowStopOptions,
    defaults=SlowStopOptions(v_0=3.0, p_front=40e5, p_rear=40e5, gradient=0.0, duration=5.0),
    cases=slow_stop,
    judge=judge_slow_stop,
    kpis=SLOW_FIGURES.units,
    figures=("time-traces", "energy-balance"),
)


# --- Held on a slope, then released

_OPENED, _ROLLS = 0.5, 1.5  # s from the release to free rolling, and its maximum duration

HOLD_FIGURES = Figures(
    undefined="the vehicle does not stop before the release",
    stopping_time=("s", "Time until the first standstill."),
    creep_speed=("m/s", f"Maximum speed from {_CALM:g} s after the standstill to the release."),
    creep=("m", "Distance in that time."),
    held_time=("s", "Length of that time."),
    roll_off=(
        "m/s**2",
        f"Mean downhill acceleration, from {_OPENED:g} s after the release on.",
    ),
    free_roll_off=(
        "m/s**2",
        "Closed form of roll_off: slope minus rolling resistance, with wheel inertia.",
    ),
)


class SlopeHoldOptions(WalkingPaceOptions):
    """Stop, slope and hold time. Slip and lift control are off."""

    t_release: Duration
    """time of the release"""
    duration: Duration
    """recording time"""


def slope_hold(
    par: TwoWheelerParameters, options: SlopeHoldOptions, _: object = None
) -> tuple[Case, ...]:
    """Return the single run."""
    if not options.t_release < options.duration:
        release = shown(options.t_release, "s")
        end = f"< options.duration = {shown(options.duration, 's')}"
        raise not_valid(
            "options.t_release", release, end, "because the recording must contain the release"
        )

    def held(p: float) -> Course:
        return lambda t: np.where(t < options.t_release - 1e-9, p, 0.0)

    demands = {"p_f_set": held(options.p_front), "p_r_set": held(options.p_rear)}
    changes = _uncontrolled(options.gradient)
    return (rolling_case(par, options.v_0, demands, options.duration, changes),)


def free_roll_off(par: VehicleParameters) -> float:
    r"""Return the downhill acceleration of the free vehicle [m/s^2].

    .. math:: a = g (|\sin\gamma| - C_{rr} \cos\gamma) \frac{m}{m + \sum J/r^2},

    but at least zero, because the vehicle stays at rest on a slope below the rolling resistance.
    Each wheel supports its part of the weight. The formula neglects air drag.
    """
    body, front, rear = par.body, par.front_wheel, par.rear_wheel
    slope = road.slope(0.0, par.road)
    share = two_wheeler_body.static_load(slope.cosine, body) / (body.m * body.g * slope.cosine)
    rolling = (1.0 - share) * front.C_rr + share * rear.C_rr
    pulled = body.g * (abs(slope.sine) - rolling * slope.cosine)
    inertia = body.m + front.J / front.r**2 + rear.J / rear.r**2
    return float(max(pulled, 0.0) * body.m / inertia)


def judge_slope_hold(recordings: Recordings, options: SlopeHoldOptions) -> tuple[Kpi, ...]:
    """Return the vehicle's creep and roll-off."""
    run = recordings["run"]
    t, x, v = (run[name].values for name in ("time", "x", "v"))
    end = vehicle_stop.standstill(t, v)
    held = (t >= end + _CALM) & (t < options.t_release)
    rolls = (t >= options.t_release + _OPENED) & (t <= options.t_release + _OPENED + _ROLLS)
    stays = math.isfinite(end) and end < options.t_release
    short = (
        math.nan,
        f"the brakes hold for less than {_CALM:g} s" if stays else "the vehicle does not stop",
    )
    brief = (math.nan, f"the recording ends less than {_OPENED:g} s after the release")
    return HOLD_FIGURES(
        stopping_time=end if stays else math.nan,
        creep_speed=float(np.max(np.abs(v[held]))) if held.any() else short,
        creep=float(np.ptp(x[held])) if held.any() else short,
        held_time=float(np.ptp(t[held])) if held.any() else short,
        roll_off=_slope(t[rolls], v[rolls], options.gradient) if rolls.sum() > 1 else brief,
        free_roll_off=free_roll_off(vehicle_of(run)),
    )


def _slope(t: Array, v: Array, gradient: float) -> float:
    """Return the mean downhill acceleration."""
    return float((v[-1] - v[0]) / (t[-1] - t[0])) * (-1.0 if gradient > 0.0 else 1.0)


SLOPE_HOLD = Experiment(
    name="slope-hold",
    assembly="two-wheeler-by-wire",
    summary="stop from {v_0} on a slope of {gradient:%}, held until {t_release}, then released",
    options=SlopeHoldOptions,
    defaults=SlopeHoldOptions(
        v_0=3.0, p_front=40e5, p_rear=40e5, gradient=0.05, t_release=23.0, duration=25.0
    ),
    cases=slope_hold,
    judge=judge_slope_hold,
    kpis=HOLD_FIGURES.units,
    figures=("time-traces",),
)
