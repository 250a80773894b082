"""Straight stop: the rider demands more than the road holds, with slip control or without."""

from __future__ import annotations

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.two_wheeler.case import (
    Demand,
    RidingSpeed,
    judged_stop,
    rolling_case,
    time_to_stop,
)
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.vehicle import stop_figures

_FROM = 100.0 / 3.6


class Options(ParameterSet):
    """The stop; road and controllers are parameters."""

    v_0: RidingSpeed
    """speed at the start"""
    p_front: Demand
    """front pressure that the rider demands"""
    p_rear: Demand
    """rear pressure that the rider demands"""
    duration: Duration
    """time recorded; long enough for locked wheels on this road unless given"""


def cases(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    demands = {"p_f_set": options.p_front, "p_r_set": options.p_rear}
    return (rolling_case(par, options.v_0, demands, options.duration),)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of the stop."""
    return judged_stop(recordings["run"], options.v_0)


def following(par: TwoWheelerParameters) -> dict[str, float]:
    """Return how long is recorded unless it is given [s]."""
    return {"duration": time_to_stop(_FROM, par)}


EXPERIMENT = Experiment(
    name="straight-stop",
    assembly="two-wheeler",
    summary="panic stop from 100 km/h, 40 bar on both brakes; road and control are parameters",
    options=Options,
    defaults=Options(v_0=_FROM, p_front=40e5, p_rear=40e5, duration=10.0),
    cases=cases,
    judge=judge,
    kpis=stop_figures.units(),
    figures=("time-traces", "energy-balance"),
    following=following,
)
