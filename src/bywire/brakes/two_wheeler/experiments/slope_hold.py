"""Slope hold: stop on a slope, held there, then let go."""

from __future__ import annotations

import math

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import vehicle_stop
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.two_wheeler.case import Course, Demand, RidingSpeed, rolling_case, vehicle_of
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.core.typing import Array
from bywire.plant import road, two_wheeler_body
from bywire.plant.road import Gradient
from bywire.vehicle.two_wheeler import VehicleParameters

_CALM = 2.0  # s after the stop
_OPENED, _ROLLS = 0.5, 1.5  # s after letting go: from when on it rolls freely, and how long at most

FIGURES = Figures(
    undefined="the vehicle does not stop before it is let go",
    stopping_time=("s", "Time from zero to the first standstill."),
    creep_speed=("m/s", f"Largest speed from {_CALM:g} s after it until the brakes are let go."),
    creep=("m", "Distance in that time."),
    held_time=("s", "That time."),
    roll_off=(
        "m/s**2",
        f"Mean acceleration downhill, from {_OPENED:g} s after letting go on.",
    ),
    free_roll_off=(
        "m/s**2",
        "The same in closed form: slope less rolling resistance, wheels turning along.",
    ),
)


class Options(ParameterSet):
    """Stop, slope, and how long it is held; slip and lift control stay off."""

    v_0: RidingSpeed
    """speed at the start"""
    p_front: Demand
    """front pressure that the rider demands"""
    p_rear: Demand
    """rear pressure that the rider demands"""
    gradient: Gradient
    """rise over run, uphill positive"""
    t_release: Duration
    """time at which the rider lets go"""
    duration: Duration
    """time recorded"""


def cases(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    if not options.t_release < options.duration:
        raise ParameterError(
            f"options.t_release = {options.t_release:g} s is not within options.duration = "
            f"{options.duration:g} s: what follows the release would not be recorded"
        )

    def held(p: float) -> Course:
        return lambda t: np.where(t < options.t_release - 1e-9, p, 0.0)

    demands = {"p_f_set": held(options.p_front), "p_r_set": held(options.p_rear)}
    changes = {
        "vehicle.road.gradient": options.gradient,
        "vehicle.road.gradient_further": options.gradient,
        "ecu.abs": "off",
        "ecu.lift": "off",
        "ecu.p_rate": 1e12,  # the rider's hand is as fast as the circuit
    }
    return (rolling_case(par, options.v_0, demands, options.duration, changes),)


def free_roll_off(par: VehicleParameters) -> float:
    r"""Return the acceleration of the free vehicle downhill [m/s^2].

    .. math:: a = g (|\sin\gamma| - C_{rr} \cos\gamma) \frac{m}{m + \sum J/r^2},

    at least zero: below the slope of the rolling resistance it stays. Both wheels have their
    share of the weight, and air drag is left out.
    """
    body, front, rear = par.body, par.front_wheel, par.rear_wheel
    slope = road.slope(0.0, par.road)
    share = two_wheeler_body.static_load(slope.cosine, body) / (body.m * body.g * slope.cosine)
    rolling = (1.0 - share) * front.C_rr + share * rear.C_rr
    pulled = body.g * (abs(slope.sine) - rolling * slope.cosine)
    inertia = body.m + front.J / front.r**2 + rear.J / rear.r**2
    return float(max(pulled, 0.0) * body.m / inertia)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return how the vehicle stays, and how it rolls off."""
    run = recordings["run"]
    t, x, v = (run[name].values for name in ("time", "x", "v"))
    end = vehicle_stop.standstill(t, v)
    held = (t >= end + _CALM) & (t < options.t_release)
    rolls = (t >= options.t_release + _OPENED) & (t <= options.t_release + _OPENED + _ROLLS)
    stays = math.isfinite(end) and end < options.t_release
    short = (math.nan, f"it is held for less than {_CALM:g} s" if stays else "it does not stop")
    brief = (math.nan, f"less than {_OPENED:g} s are recorded after the release")
    return FIGURES(
        stopping_time=end if stays else math.nan,
        creep_speed=float(np.max(np.abs(v[held]))) if held.any() else short,
        creep=float(np.ptp(x[held])) if held.any() else short,
        held_time=float(np.ptp(t[held])) if held.any() else short,
        roll_off=_slope(t[rolls], v[rolls], options.gradient) if rolls.sum() > 1 else brief,
        free_roll_off=free_roll_off(vehicle_of(run)),
    )


def _slope(t: Array, v: Array, gradient: float) -> float:
    """Return how much faster it gets downhill, on average."""
    return float((v[-1] - v[0]) / (t[-1] - t[0])) * (-1.0 if gradient > 0.0 else 1.0)


EXPERIMENT = Experiment(
    name="slope-hold",
    assembly="two-wheeler-by-wire",
    summary="stop from {v_0} on a slope of {gradient:%}, held until {t_release}, then let go",
    options=Options,
    defaults=Options(
        v_0=3.0, p_front=40e5, p_rear=40e5, gradient=0.05, t_release=23.0, duration=25.0
    ),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces",),
)
