"""Straight stop with a whole brake by wire at the rear wheel, and what its actuator takes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis.families import units_of
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.bench.kpis.vehicle_stop import standstill
from bywire.brakes.two_wheeler.case import JUDGE, locked_stop, on_surface, rolling_case
from bywire.brakes.two_wheeler.experiments.straight_stop import Options
from bywire.brakes.two_wheeler.parameters import WholeRearParameters
from bywire.brakes.two_wheeler.rigs.whole_rear import TwoWheelerWholeRear, at_speed

FIGURES = Figures(
    rear_energy=("J", "Energy that the rear brake draws until the vehicle stands."),
    rear_current=("A", "Largest magnitude of the current of its motor until then."),
    rear_pressure_error=(
        "Pa",
        "Root mean square of what the rear brake is asked for less the pressure at its pads.",
    ),
)
_SIGNALS = ("v", "E_rear_source", "rear_i", "p_r_ref", "p_r")


def cases(par: WholeRearParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    demands = {"p_f_set": options.p_front, "p_r_set": options.p_rear}
    changes = {**on_surface(options.surface), "rear.actuator.drive.mode": "pressure"}
    duration = options.duration or locked_stop(options.v_0, par.replace(changes).vehicle)
    vehicle = (TwoWheelerWholeRear, at_speed)
    return (rolling_case(par, options.v_0, demands, duration, changes, vehicle=vehicle),)


def price(run: xr.Dataset, options: Options) -> tuple[Kpi, ...]:
    """Return what the rear actuator takes until the vehicle stands, or to the end."""
    t, *signals = (run[name].values for name in ("time", *_SIGNALS))
    end = standstill(t, signals[0])
    braked = (t >= 0.0) & (t <= (end if math.isfinite(end) else math.inf))
    energy, current, p_ref, p = (each[braked] for each in signals[1:])
    return FIGURES(
        rear_energy=float(energy[-1] - energy[0]),
        rear_current=float(np.abs(current).max()),
        rear_pressure_error=float(np.sqrt(np.mean((p_ref - p) ** 2))),
    )


EXPERIMENT = Experiment(
    name="whole-rear-stop",
    assembly="two-wheeler-whole-rear",
    summary="panic stop with the whole motorcycle brake by wire at the rear wheel, {p_rear}",
    options=Options,
    defaults=Options(v_0=30.0, p_front=40e5, p_rear=40e5, surface="wet-asphalt", duration=0.0),
    cases=cases,
    judge=replace(JUDGE, further=price, further_signals=_SIGNALS),
    kpis=FIGURES.units | units_of("vehicle_stop"),
    figures=("road-marks", "time-traces", "energy-balance"),
)
