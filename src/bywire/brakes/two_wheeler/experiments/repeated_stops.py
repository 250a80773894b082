"""Repeated stops: brakes that warm up from stop to stop, fade, and heat their fluid once parked.

The stops run one after the other, each from the temperatures that the last one left. Between them
no brake acts, and only heat is left to be told: three temperatures a wheel, over minutes. That
stretch is integrated by the equations of the same element, at the speed driven, by a method of high
order with error control in place of substeps of 20 us; the vehicle is back at its speed at once.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Annotated, Literal, NamedTuple

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import vehicle_stop
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.two_wheeler import stop_series
from bywire.brakes.two_wheeler.case import RidingSpeed, rolling_case
from bywire.brakes.two_wheeler.model import TwoWheelerByWire
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.brakes.two_wheeler.stop_series import BRAKES, TEMPERATURES, WARM, Heat
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Unit, Weight
from bywire.core.signals import Signal, signals_of
from bywire.core.typing import Array
from bywire.plant import brake_disc, disc_heat
from bywire.vehicle.hot_brakes import cold_start

_COURSE = "course-temperatures"
_ROWS, _PARKED_ROWS = 40, 600  # of a pause, and of the time parked
_USUAL, _LONGEST, _AFTER = 1.3, 3.0, 1.0  # times the length of a cold stop; s beyond a standstill
_STOP = Signal("1", "number of the stop, 0 between stops")

EACH = Figures(
    disc_before=("K", "Temperature of the front discs when the stop begins."),
    disc_after=("K", "Temperature of the front discs at standstill."),
)
ALL = Figures(
    distance_first=("m", "Distance of the first stop."),
    distance_last=("m", "Distance of the last stop."),
    longer=("%", "What the last stop takes more than the first."),
    pads_last=("K", "Temperature of the front pads after the last stop."),
    fluid_last=("K", "Temperature of the front fluid after the last stop."),
    rear_disc_last=("K", "Temperature of the rear disc after the last stop."),
    pressure_cold=("Pa", "Front pressure for the deceleration with cold pads."),
    pressure_hot=("Pa", "The same with pads as they are after the last stop."),
    fluid_peak=("K", "Highest temperature of the front fluid, the time parked included."),
    fluid_peak_time=("s", "Time of it after the last standstill."),
)


class Options(ParameterSet):
    """The stops, and the way from one to the next.

    ``hold``: the rider presses alike in every stop (``"pressure"``), or by as much more as the pads
    have faded when it begins (``"deceleration"``).
    """

    v_0: RidingSpeed
    """speed at the start of each stop"""
    deceleration: Annotated[float, Unit("m/s**2", 8.0), Field(gt=0, allow_inf_nan=False)]
    """what cold brakes give the vehicle's mass, drag and rolling resistance apart"""
    share: Weight
    """share of the braking force that the front brake gives"""
    hold: Literal["pressure", "deceleration"]
    """what the rider holds from stop to stop"""
    stops: Annotated[float, Unit("1", 10.0), Field(ge=1, le=200, multiple_of=1)]
    """number of stops"""
    pause: Duration
    """time driven from a standstill to the next stop"""
    v_pause: Annotated[float, Unit("m/s", 28.0), Field(ge=0, allow_inf_nan=False)]
    """speed in that time"""
    parked: Duration
    """time parked after the last stop"""


class _Stop(NamedTuple):
    """A stop, and its rows to the standstill."""

    case: Case
    rows: dict[str, Array]


def cases(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the first and the last stop, this from what all those before it left."""
    every = _series(par.replace(WARM), options)
    return tuple(
        replace(stop.case, label=label, duration=round(stop.rows["time"][-1] + _AFTER, 1))
        for label, stop in (("first", every[0]), ("last", every[-1]))
    )


def preview(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return both as if the brakes were cold."""
    warm = par.replace(WARM)
    cold = cold_start(warm.front.heat, warm.rear.heat)
    return tuple(_case(warm, options, cold, label) for label in ("first", "last"))


@lru_cache(maxsize=8)
def _series(par: TwoWheelerParameters, options: Options) -> tuple[_Stop, ...]:
    """Return all stops, one after the other."""
    heat: Heat = cold_start(par.front.heat, par.rear.heat)
    stops: list[_Stop] = []
    for k in range(round(options.stops)):
        if stops:
            left, way = stop_series.at_end(stops[-1].rows), np.array([0.0, options.pause])
            heat = stop_series.at_end(stop_series.cooled(left, par, options.v_pause, way))
        case = _case(par, options, heat, f"stop {k + 1}")
        try:
            rows = stop_series.braked(case)
        except ParameterError:  # faded brakes take longer
            rows = stop_series.braked(replace(case, duration=case.duration * _LONGEST))
        stops.append(_Stop(case, rows))
    return tuple(stops)


def _case(par: TwoWheelerParameters, options: Options, start: Heat, label: str) -> Case:
    demands = {}
    shares = {"p_f_set": options.share, "p_r_set": 1.0 - options.share}
    for (name, share), (part, (brake, _)) in zip(shares.items(), BRAKES.items(), strict=True):
        left = 1.0
        if options.hold == "deceleration":
            left = disc_heat.friction(start[part].T_disc, par.value(f"{brake}.heat"))
        demands[name] = share * _pressure(par, options, brake) / left
    duration = round(_USUAL * options.v_0 / options.deceleration + _AFTER, 1)
    return rolling_case(par, options.v_0, demands, duration, label=label, heat=start)


def _pressure(par: TwoWheelerParameters, options: Options, brake: str) -> float:
    """Return the pressure [Pa] at which one cold brake alone gives the deceleration."""
    torque = par.vehicle.body.m * options.deceleration * par.value(f"vehicle.{brake}_wheel.r")
    return float(torque / brake_disc.torque_per_pressure(par.value(f"{brake}.disc")))


def static(par: TwoWheelerParameters, options: Options) -> dict[str, xr.Dataset]:
    """Return the temperatures over all stops, the ways between them, and the time parked."""
    warm, begin, pieces = par.replace(WARM), 0.0, []
    every = _series(warm, options)
    for k, (_, rows) in enumerate(every):
        pieces.append(rows | {"time": begin + rows["time"], "stop": 0.0 * rows["v"] + k + 1})
        begin += float(rows["time"][-1])
        is_last = k + 1 == len(every)
        v = 0.0 if is_last else options.v_pause
        whole, count = (options.parked, _PARKED_ROWS) if is_last else (options.pause, _ROWS)
        t = np.linspace(0.0, whole, count + 1)
        after = stop_series.cooled(stop_series.at_end(rows), warm, v, t)
        inside = slice(1, None if is_last else -1)  # the next stop has the last instant
        rest = {name: y[inside] for name, y in after.items()}
        still = 0.0 * rest["time"]
        pieces.append(rest | {"time": begin + rest["time"], "v": still + v, "stop": still})
        begin += whole
    return {_COURSE: _dataset(warm, pieces)}


def _dataset(par: TwoWheelerParameters, pieces: list[dict[str, Array]]) -> xr.Dataset:
    known = signals_of(TwoWheelerByWire.Output) | {"stop": _STOP}
    names = ("time", "v", "stop", *TEMPERATURES)
    rows = {name: np.concatenate([each[name] for each in pieces]) for name in names}
    t = rows.pop("time")
    said = [
        f"{brake} brake: {text}"
        for brake, end in BRAKES.values()
        for text in disc_heat.watch(
            t,
            disc_heat.State._make(rows[name + end] for name in disc_heat.State._fields),
            par.value(f"{brake}.heat"),
        )
    ]
    values = {
        name: ("time", y, {"units": known[name].unit, "long_name": known[name].label})
        for name, y in rows.items()
    }
    time = ("time", t, {"units": "s", "long_name": "time"})
    return xr.Dataset(values, {"time": time}, {"warnings": "; ".join(said)})


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return temperatures of every stop, and what the heat costs."""
    course, stops = recordings[_COURSE], range(1, round(options.stops) + 1)
    disc, number = course["T_disc_f"].values, course["stop"].values
    each = [disc[number == k] for k in stops]
    kpis = [
        kpi
        for k, T in zip(stops, each, strict=True)
        for kpi in EACH(f"_{k}", disc_before=float(T[0]), disc_after=float(T[-1]))
    ]
    last = int(np.flatnonzero(number)[-1])
    hot = stop_series.heat_of(course, "_f", last)
    par = TwoWheelerParameters.model_validate_json(recordings["first"].attrs["parameters"])
    cold = options.share * _pressure(par, options, "front")
    fluid, t = course["T_fluid_f"].values, course["time"].values
    distances = [_distance(recordings[label]) for label in ("first", "last")]
    return (
        *kpis,
        *ALL(
            distance_first=distances[0],
            distance_last=distances[1],
            longer=100.0 * (distances[1] / distances[0] - 1.0),
            pads_last=hot.T_pads,
            fluid_last=hot.T_fluid,
            rear_disc_last=float(course["T_disc_r"][last]),
            pressure_cold=cold,
            pressure_hot=cold / disc_heat.friction(hot.T_disc, par.front.heat),
            fluid_peak=float(fluid.max()),
            fluid_peak_time=stop_series.peak_time(t[last:] - t[last], fluid[last:]),
        ),
    )


def _distance(run: xr.Dataset) -> float:
    """Return the distance of a stop [m]."""
    t = run["time"].values
    return float(np.interp(vehicle_stop.standstill(t, run["v"].values), t, run["x"].values))


def named(options: Options) -> dict[str, str]:
    """Return the unit of every key figure."""
    return EACH.ending(*(f"_{k + 1}" for k in range(round(options.stops)))) | ALL.units


_DEFAULTS = Options(
    v_0=100.0 / 3.6,
    deceleration=8.0,
    share=0.8,
    hold="pressure",
    stops=10.0,
    pause=30.0,
    v_pause=100.0 / 3.6,
    parked=900.0,
)

EXPERIMENT = Experiment(
    name="repeated-stops",
    assembly="two-wheeler-by-wire",
    summary="repeated stops ({stops}) from {v_0:km/h} at {deceleration} every {pause} with brakes "
    "that warm up, then parked",
    options=Options,
    defaults=_DEFAULTS,
    cases=cases,
    judge=judge,
    kpis=named(_DEFAULTS),
    figures=("overlaid-traces",),
    static=static,
    preview=preview,
    named=named,
    compared={
        "v": "speed",
        "a": "deceleration",
        "p_f": "front pressure",
        "T_disc_f": "front discs",
        "T_pads_f": "front pads",
        "T_fluid_f": "front fluid",
        "T_disc_r": "rear disc",
    },
)
