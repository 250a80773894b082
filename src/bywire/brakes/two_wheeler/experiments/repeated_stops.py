"""Repeated stops: brakes that warm up from stop to stop, fade, and heat their fluid once parked.

Each stop starts from the final temperatures of the previous stop. Between the stops, no brake acts
and only heat flows, with three temperatures per wheel, over minutes
(`bywire.procedures.cooling`). The vehicle regains its speed instantly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings, as_run
from bywire.bench.kpis import vehicle_stop
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.two_wheeler.case import rolling_case
from bywire.brakes.two_wheeler.model import TwoWheelerByWire
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.errors import ParameterError
from bywire.core.interrupts import interrupts_deferred
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Unit, Weight
from bywire.core.signals import Signal, signals_of
from bywire.core.typing import Array
from bywire.plant import brake_disc, disc_heat
from bywire.procedures import cooling
from bywire.simulation.engine import prepare
from bywire.simulation.run import simulate
from bywire.vehicle.ideal_stop import RidingSpeed
from bywire.vehicle.two_wheeler import cold_start

if TYPE_CHECKING:
    import xarray as xr

Heat = Mapping[str, disc_heat.State]
"""brake temperatures by part"""
WARM = {"front.heat.law": "lumped", "rear.heat.law": "lumped"}
BRAKES = {"front_heat": ("front", "_f"), "rear_heat": ("rear", "_r")}
"""name and suffix of each brake, by its heat part"""
TEMPERATURES = tuple(n + end for _, end in BRAKES.values() for n in disc_heat.State._fields)
_SUBSTEPS = 50  # per sample time


def braked(case: Case) -> dict[str, Array]:
    """Return speed, position and temperatures of a stop, row by row until standstill.

    Raises
    ------
    ParameterError
        If the vehicle does not come to a standstill.
    """
    run = as_run(case, case.par.ecu.T_s / _SUBSTEPS)  # type: ignore[attr-defined]
    with interrupts_deferred():
        prepare(run.model, run.par).engine()
    stop = simulate(run, ("v", "x", *TEMPERATURES))
    if stop.status == "interrupted":
        raise KeyboardInterrupt
    end = vehicle_stop.standstill(stop.time, stop["v"])
    if math.isnan(end):
        raise ParameterError(
            f"{case.label} does not reach a standstill within {case.duration:g} s, because the "
            "brakes fade or the road is too slippery. Reduce options.stops or "
            "options.deceleration, or increase options.pause",
            name=case.label,
            valid=f"{case.duration:g} s",
        )
    t = np.append(stop.time[stop.time < end], end)
    return {"time": t} | {
        name: np.interp(t, stop.time, stop[name]) for name in ("v", "x", *TEMPERATURES)
    }


def cooled(heat: Heat, par: TwoWheelerParameters, v: float, t: Array) -> dict[str, Array]:
    """Return the temperatures [K] of open brakes by signal, which start at ``heat``.

    Parameters
    ----------
    par
        Parameters of a vehicle whose brakes warm up.
    v
        Vehicle speed [m/s].
    t
        Times [s], increasing from 0.
    """
    rows: dict[str, Array] = {"time": t}
    for part, (brake, end) in BRAKES.items():
        course = cooling.cooled(heat[part], par.value(f"{brake}.heat"), v, t)
        rows |= {f"{name}{end}": y for name, y in course.items()}
    return rows


def at_end(rows: Mapping[str, Array]) -> Heat:
    """Return the temperatures of the last row."""
    return {part: heat_of(rows, end, -1) for part, (_, end) in BRAKES.items()}


def heat_of(rows: Any, end: str, k: int) -> disc_heat.State:
    """Return the temperatures of the brake with a suffix, in row ``k`` of rows or a recording."""
    return disc_heat.State(*(float(rows[n + end][k]) for n in disc_heat.State._fields))


def peak_time(t: Array, T: Array) -> float | tuple[float, str]:
    """Return the time of the maximum temperature [s], from a parabola through its highest rows."""
    k = int(T.argmax())
    if k + 1 == t.size:
        return math.nan, "the fluid is still warming up at the end. Increase options.parked"
    if k == 0:
        return 0.0
    bend, slope, _ = np.polyfit(t[k - 1 : k + 2] - t[k], T[k - 1 : k + 2] - T[k], 2)
    return float(t[k] - 0.5 * slope / bend)


_COURSE = "course-temperatures"
_ROWS, _PARKED_ROWS = 40, 600  # of a pause, and of the time parked
_USUAL, _LONGEST, _AFTER = 1.3, 3.0, 1.0  # lengths of a cold stop; s after standstill
_STOP = Signal("1", "number of the stop, 0 between stops")

EACH = Figures(
    disc_before=("K", "Front disc temperature at the start of the stop."),
    disc_after=("K", "Front disc temperature at standstill."),
)
ALL = Figures(
    distance_first=("m", "Distance of the first stop."),
    distance_last=("m", "Distance of the last stop."),
    longer=("%", "Extra distance of the last stop, relative to the first."),
    pads_last=("K", "Front pad temperature after the last stop."),
    fluid_last=("K", "Front fluid temperature after the last stop."),
    rear_disc_last=("K", "Rear disc temperature after the last stop."),
    pressure_cold=("Pa", "Front pressure that the deceleration needs with cold brakes."),
    pressure_hot=("Pa", "Front pressure that the deceleration needs after the last stop."),
    fluid_peak=("K", "Maximum front fluid temperature, including the time parked."),
    fluid_peak_time=("s", "Time from the last standstill to this maximum."),
)


class Options(ParameterSet):
    """The stops, and the drive from one stop to the next.

    ``hold``: the rider applies the same pressure in every stop (``"pressure"``), or increases it in
    proportion to the pad fading at the start of the stop (``"deceleration"``).
    """

    v_0: RidingSpeed
    """initial speed of each stop"""
    deceleration: Annotated[float, Unit("m/s**2", 8.0), Field(gt=0, allow_inf_nan=False)]
    """deceleration by cold brakes alone, without drag and rolling resistance"""
    share: Weight
    """fraction of the braking force from the front brake"""
    hold: Literal["pressure", "deceleration"]
    """quantity that stays constant from stop to stop"""
    stops: Annotated[float, Unit("1", 10.0), Field(ge=1, le=200, multiple_of=1)]
    """number of stops"""
    pause: Duration
    """driving time from one standstill to the next stop"""
    v_pause: Annotated[float, Unit("m/s", 28.0), Field(ge=0, allow_inf_nan=False)]
    """driving speed between stops"""
    parked: Duration
    """time parked after the last stop"""


class _Stop(NamedTuple):
    """A stop, and its rows until standstill."""

    case: Case
    rows: dict[str, Array]


def cases(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the first and the last stop. The last stop starts with the heat of all others."""
    every = _series(par.replace(WARM), options)
    return tuple(
        replace(stop.case, label=label, duration=round(stop.rows["time"][-1] + _AFTER, 1))
        for label, stop in (("first", every[0]), ("last", every[-1]))
    )


def preview(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return both stops with cold brakes."""
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
            left, way = at_end(stops[-1].rows), np.array([0.0, options.pause])
            heat = at_end(cooled(left, par, options.v_pause, way))
        case = _case(par, options, heat, f"stop {k + 1}")
        try:
            rows = braked(case)
        except ParameterError:  # faded brakes need longer
            rows = braked(replace(case, duration=case.duration * _LONGEST))
        stops.append(_Stop(case, rows))
    return tuple(stops)


def _case(par: TwoWheelerParameters, options: Options, start: Heat, label: str) -> Case:
    demands = {}
    shares = {"p_f_set": options.share, "p_r_set": 1.0 - options.share}
    for (name, share), (part, (brake, _)) in zip(shares.items(), BRAKES.items(), strict=True):
        friction = 1.0
        if options.hold == "deceleration":
            friction = disc_heat.friction(start[part].T_disc, par.value(f"{brake}.heat"))
        demands[name] = share * _pressure(par, options, brake) / friction
    duration = round(_USUAL * options.v_0 / options.deceleration + _AFTER, 1)
    return rolling_case(par, options.v_0, demands, duration, label=label, heat=start)


def _pressure(par: TwoWheelerParameters, options: Options, brake: str) -> float:
    """Return the pressure [Pa] at which one cold brake alone produces the deceleration."""
    torque = par.vehicle.body.m * options.deceleration * par.value(f"vehicle.{brake}_wheel.r")
    return float(torque / brake_disc.torque_per_pressure(par.value(f"{brake}.disc")))


def static(par: TwoWheelerParameters, options: Options) -> dict[str, xr.Dataset]:
    """Return the temperatures during all stops, the drives between them, and the time parked."""
    warm, begin, pieces = par.replace(WARM), 0.0, []
    every = _series(warm, options)
    for k, (_, rows) in enumerate(every):
        pieces.append(rows | {"time": begin + rows["time"], "stop": 0.0 * rows["v"] + k + 1})
        begin += float(rows["time"][-1])
        is_last = k + 1 == len(every)
        v = 0.0 if is_last else options.v_pause
        whole, count = (options.parked, _PARKED_ROWS) if is_last else (options.pause, _ROWS)
        t = np.linspace(0.0, whole, count + 1)
        after = cooled(at_end(rows), warm, v, t)
        inside = slice(1, None if is_last else -1)  # the next stop contains the last row
        rest = {name: y[inside] for name, y in after.items()}
        still = 0.0 * rest["time"]
        pieces.append(rest | {"time": begin + rest["time"], "v": still + v, "stop": still})
        begin += whole
    return {_COURSE: _dataset(warm, pieces)}


def _dataset(par: TwoWheelerParameters, pieces: list[dict[str, Array]]) -> xr.Dataset:
    import xarray as xr  # slow to load

    known = signals_of(TwoWheelerByWire.Output) | {"stop": _STOP}
    names = ("time", "v", "stop", *TEMPERATURES)
    rows = {name: np.concatenate([each[name] for each in pieces]) for name in names}
    t = rows.pop("time")
    warnings = [
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
    return xr.Dataset(values, {"time": time}, {"warnings": warnings})


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the temperatures of each stop, and the effects of the heat."""
    course, stops = recordings[_COURSE], range(1, round(options.stops) + 1)
    disc, number = course["T_disc_f"].values, course["stop"].values
    each = [disc[number == k] for k in stops]
    kpis = [
        kpi
        for k, T in zip(stops, each, strict=True)
        for kpi in EACH(f"_{k}", disc_before=float(T[0]), disc_after=float(T[-1]))
    ]
    last = int(np.flatnonzero(number)[-1])
    hot = heat_of(course, "_f", last)
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
            fluid_peak_time=peak_time(t[last:] - t[last], fluid[last:]),
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
    summary="{stops} stops from {v_0:km/h} at {deceleration}, {pause} apart, with brakes that "
    "warm up, then parked",
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
