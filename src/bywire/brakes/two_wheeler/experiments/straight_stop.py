"""Straight stop: the rider demands more than the road holds, with slip control or without."""

from __future__ import annotations

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis.families import units_of
from bywire.brakes.two_wheeler.case import (
    JUDGE,
    Demand,
    RidingSpeed,
    locked_stop,
    on_surface,
    rolling_case,
)
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import TimeConstant
from bywire.plant.road import SurfaceName

_FROM = 100.0 / 3.6


class Options(ParameterSet):
    """The stop, and the surface; slope and controllers are parameters."""

    v_0: RidingSpeed
    """speed at the start"""
    p_front: Demand
    """front pressure that the rider demands"""
    p_rear: Demand
    """rear pressure that the rider demands"""
    surface: SurfaceName
    """what the road is made of"""
    duration: TimeConstant
    """time recorded; 0 for as long as locked wheels take on this surface, and a little more"""


def cases(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    demands = {"p_f_set": options.p_front, "p_r_set": options.p_rear}
    changes = on_surface(options.surface)
    duration = options.duration or locked_stop(options.v_0, par.replace(changes).vehicle)
    return (rolling_case(par, options.v_0, demands, duration, changes),)


EXPERIMENT = Experiment(
    name="straight-stop",
    assembly="two-wheeler-by-wire",
    summary="panic stop from {v_0:km/h} with {p_front} in front and {p_rear} behind, on {surface}",
    options=Options,
    defaults=Options(v_0=_FROM, p_front=40e5, p_rear=40e5, surface="dry-asphalt", duration=0.0),
    cases=cases,
    judge=JUDGE,
    kpis=units_of("vehicle_stop"),
    figures=("road-marks", "time-traces", "energy-balance"),
)
