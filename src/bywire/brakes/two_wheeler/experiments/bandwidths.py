"""Bandwidths: the same stop with ever quicker brakes, for what speed of the actuator buys."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.two_wheeler.case import (
    JUDGE,
    Demand,
    RidingSpeed,
    on_surface,
    rolling_case,
)
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Nodes, Unit
from bywire.plant.road import SurfaceName

_SHOWN = {
    "stopping_distance": "m",
    "braking_efficiency": "%",
    "peak_slip_front": "1",
    "jerk": "m/s**3",
    "locked_time_front": "s",
}


class Options(ParameterSet):
    """The stop, and the natural frequencies of both pressure loops."""

    v_0: RidingSpeed
    """speed at the start"""
    p_front: Demand
    """front pressure that the rider demands"""
    p_rear: Demand
    """rear pressure that the rider demands"""
    surface: SurfaceName
    """what the road is made of"""
    f_n: Annotated[Nodes, Unit("Hz", 10.0), Field(min_length=1)]
    """natural frequencies of the pressure loops, one run each"""
    duration: Duration
    """time recorded"""


def _label(f: float) -> str:
    return f"{f:g} Hz"


def cases(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return a run for each frequency."""
    demands = {"p_f_set": options.p_front, "p_r_set": options.p_rear}
    return tuple(
        rolling_case(
            par,
            options.v_0,
            demands,
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


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return what tells the stops apart, with the frequency behind each name."""
    return tuple(
        Kpi(f"{kpi.name}_{f:g}Hz", kpi.value, kpi.unit, kpi.definition, kpi.note)
        for f in options.f_n
        for kpi in JUDGE({"run": recordings[_label(f)]}, options)
        if kpi.name in _SHOWN
    )


def named(options: Options) -> dict[str, str]:
    """Return the unit of every key figure."""
    return {f"{name}_{f:g}Hz": unit for f in options.f_n for name, unit in _SHOWN.items()}


_DEFAULTS = Options(
    v_0=30.0,
    p_front=40e5,
    p_rear=40e5,
    surface="wet-asphalt",
    f_n=(2.0, 3.0, 5.0, 10.0, 20.0, 40.0, 100.0),
    duration=7.0,
)

EXPERIMENT = Experiment(
    name="bandwidths",
    assembly="two-wheeler-by-wire",
    summary="controlled stops from {v_0} on {surface} with pressure loops of {f_n}",
    options=Options,
    defaults=_DEFAULTS,
    cases=cases,
    judge=judge,
    kpis=named(_DEFAULTS),
    named=named,
    figures=("overlaid-traces",),
    compared={
        "v": "speed",
        "a": "deceleration",
        "slip_f": "front slip",
        "p_f": "front pressure",
    },
)
