"""The event-driven plant in the package's clothes: its parameters, and the ECU's code on floats."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.brakes.motorcycle import ecu as motorcycle_ecu
from bywire.brakes.motorcycle.ecu import Readings, Stimulus
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.plant import current_sensor, pressure_sensor
from bywire.simulation.run import Run
from reference.event_driven import STATES, Controller, Plant, simulate

GROUPS = (
    "motor",
    "supply",
    "gear",
    "master_cylinder",
    "fluid",
    "pipeline",
    "caliper",
    "anti_alias",
    "seal",
)


def plant_of(par: MotorcycleParameters) -> Plant:
    """Return the reference's plant with the numbers of a parameter set."""
    known: dict[str, Any] = {}
    for group in GROUPS:
        known |= getattr(par, group).model_dump()
    wanted = {f.name: known[f.name] for f in fields(Plant) if f.name in known}
    return Plant(**wanted, gear=par.gear.law)


def run_reference(run: Run, step: float) -> dict[str, NDArray[Any]]:
    """Simulate a run of the motorcycle brake with the event-driven reference, tick by tick."""
    par, driven = run.par, run.par.drive.mode == "current-source"
    period = par.drive.T_source if driven else par.ecu.T_s
    times = period * np.arange(round(run.duration / period) + 1)
    rows = [Stimulus(*map(float, row)) for row in run.stimulus(times)]
    x0 = dict(zip(run.state._fields, map(float, run.state), strict=True))
    i = run.memory.i_source if driven else x0["i"]
    start = {name: x0[name] for name in STATES[1:5]} | {"i": i, "p_f": x0["p_mc"], "i_f": i}
    controller = _source(rows) if driven else _ecu(rows, run.memory, par)
    source = "current" if driven else "duty"
    return simulate(plant_of(par), controller, run.duration, period, start, step, source)


def _source(rows: list[Stimulus]) -> Controller:
    return lambda k, t, state: rows[k].i_set


def _ecu(rows: list[Stimulus], memory: Any, par: MotorcycleParameters) -> Controller:
    def tick(k: int, t: float, state: dict[str, float]) -> float:
        nonlocal memory
        readings = Readings(
            p=pressure_sensor.reading(state["p_f"] + par.fluid.p_atm, par.pressure_sensor),
            i=current_sensor.reading(state["i_f"], par.current_sensor),
        )
        memory = motorcycle_ecu.tick(readings, memory, rows[k], par)
        return float(memory.duty)

    return tick
