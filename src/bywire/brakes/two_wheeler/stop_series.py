"""Stops of brakes that warm up, one after the other, and the ways between them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from bywire.bench.experiment import Case, as_run
from bywire.bench.kpis import vehicle_stop
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.errors import ParameterError
from bywire.core.interrupts import interrupts_deferred
from bywire.core.typing import Array
from bywire.plant import disc_heat
from bywire.simulation.engine import prepare
from bywire.simulation.run import simulate

Heat = Mapping[str, disc_heat.State]
"""temperatures of the brakes by their parts"""
WARM = {"front.heat.law": "lumped", "rear.heat.law": "lumped"}
BRAKES = {"front_heat": ("front", "_f"), "rear_heat": ("rear", "_r")}
"""name and suffix of each brake, by the part that is its heat"""
TEMPERATURES = tuple(n + end for _, end in BRAKES.values() for n in disc_heat.State._fields)
_SUBSTEPS = 50  # of a sample time


def braked(case: Case) -> dict[str, Array]:
    """Return speed, place and temperatures of a stop, row by row to its standstill.

    Raises
    ------
    ParameterError
        When it does not come to one.
    """
    run = as_run(case, case.par.ecu.T_s / _SUBSTEPS)  # type: ignore[attr-defined]
    with interrupts_deferred():
        prepare(run.model, run.par).engine()
    made = simulate(run, ("v", "x", *TEMPERATURES))
    if made.status == "interrupted":
        raise KeyboardInterrupt
    end = vehicle_stop.standstill(made.time, made["v"])
    if math.isnan(end):
        raise ParameterError(
            f"{case.label} does not come to a standstill within {case.duration:g} s: its brakes "
            "have faded, or the road does not hold; take fewer stops, a longer options.pause or a "
            "smaller options.deceleration"
        )
    t = np.append(made.time[made.time < end], end)
    return {"time": t} | {
        name: np.interp(t, made.time, made[name]) for name in ("v", "x", *TEMPERATURES)
    }


def cooled(heat: Heat, par: TwoWheelerParameters, v: float, t: Array) -> dict[str, Array]:
    """Return temperatures [K] of open brakes by signal; those at the start are ``heat``.

    Parameters
    ----------
    par
        Parameters of a vehicle whose brakes warm up.
    v
        Speed of the vehicle [m/s].
    t
        Times [s], increasing from 0.
    """
    rows: dict[str, Array] = {"time": t}
    for part, (brake, end) in BRAKES.items():
        own: disc_heat.Parameters = par.value(f"{brake}.heat")
        felt, capacities = disc_heat.Input(0.0, v, 0.0), np.array(disc_heat.mass(own))

        def rate(_: float, T: Array, own: Any = own, u: Any = felt, C: Array = capacities) -> Array:
            return np.array(disc_heat.balance(disc_heat.State(*T), u, own)) / C

        span = (0.0, float(t[-1]))
        got = solve_ivp(rate, span, heat[part], "DOP853", t_eval=t, rtol=1e-10, atol=1e-8)
        rows |= {n + end: y for n, y in zip(disc_heat.State._fields, got.y, strict=True)}
    return rows


def at_end(rows: Mapping[str, Array]) -> Heat:
    """Return the temperatures of the last row."""
    return {part: heat_of(rows, end, -1) for part, (_, end) in BRAKES.items()}


def heat_of(rows: Any, end: str, k: int) -> disc_heat.State:
    """Return the temperatures of the brake of a suffix in row ``k`` of rows or a recording."""
    return disc_heat.State(*(float(rows[n + end][k]) for n in disc_heat.State._fields))


def peak_time(t: Array, T: Array) -> float | tuple[float, str]:
    """Return when a temperature is highest [s], by a parabola through its highest rows."""
    k = int(T.argmax())
    if k + 1 == t.size:
        return math.nan, "the fluid still warms up at the end: give a longer options.parked"
    if k == 0:
        return 0.0
    bend, slope, _ = np.polyfit(t[k - 1 : k + 2] - t[k], T[k - 1 : k + 2] - T[k], 2)
    return float(t[k] - 0.5 * slope / bend)
