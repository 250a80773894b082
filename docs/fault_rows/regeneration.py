"""Fault figures of the wedge brake's quarter car with a motor at its wheel."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.running import Result, run
from fault_rows.row import Row

EXPERIMENT, SET = "corner-blending", "roberts2003-corner-electric"
GRADIENT = -0.08
ONSET = 5.0
HILL = (("gradient", GRADIENT), ("duration", 25.0))
LAWS = ("reported", "commanded")
Pairs = tuple[tuple[str, Any], ...]


@cache
def result(fault: str, onset: float, law: str = "reported", options: Pairs = ()) -> Result:
    """Return the stop with a fault."""
    changes = {"regeneration.blending.law": law}
    faults = [{"fault": fault, "onset": onset}]
    return run(Bench(EXPERIMENT, SET, changes, options=dict(options), faults=faults))


def full(name: str, factor: float = 1.0) -> Callable[[], float]:
    """Return a key figure of the stop with a full battery at the top of a hill."""
    given = ("regeneration.battery.full", -9.0, "reported", HILL)
    return lambda: factor * {kpi.name: kpi.value for kpi in result(*given).kpis}[name]


def distance() -> float:
    """Return the distance of a stop with a constant torque after its ramp [m]."""
    bench = Bench(EXPERIMENT, SET)
    par, options = bench.par, bench.chosen_options
    body, r = par.corner.body, par.corner.r
    mass = body.m + par.flywheel.J_F / (r * r)
    slope = body.m * body.g * math.sin(math.atan(GRADIENT))
    a = (options.T_demand / r + slope) / mass
    return float(options.v_0**2 / (2.0 * a) + 0.5 * options.t_ramp * options.v_0)


def torque(law: str) -> Callable[[], float]:
    """Return the braking torque one second after the motor is lost [N m]."""

    def computed() -> float:
        found: xr.Dataset = result("wheel_motor.stuck", ONSET, law).recordings["run"]
        late = found.sel(time=slice(ONSET + 0.8, ONSET + 1.2))
        return float(np.mean(late["T_m"].values + late["M_B"].values))

    return computed


STANDARD = "the friction brake follows what the motor reports, so it takes over"
TRUSTING = (
    "the friction brake adds to the motor's set point, and does not respond to the loss of the "
    "motor. Only the minimum demand that keeps the pads on the disc remains"
)
ROWS = (
    Row(
        "regeneration.battery.full",
        f"recovered energy at the top of a hill of {-100 * GRADIENT:g} %",
        0.0,
        "kJ",
        full("recovered_energy", 1e-3),
    ),
    Row(
        "regeneration.battery.full",
        "stopping distance on the same hill",
        round(distance(), 1),
        "m",
        full("stopping_distance"),
        note="the reference is a stop with a constant torque after the ramp of the demand, without "
        "the delay of the brake",
    ),
    *(
        Row(
            "wheel_motor.stuck 0",
            f'braking torque 1 s later, law "{law}"',
            stated,
            "N m",
            torque(law),
            note=note,
        )
        for law, stated, note in zip(LAWS, (400.0, 20.0), (STANDARD, TRUSTING), strict=True)
    ),
)
