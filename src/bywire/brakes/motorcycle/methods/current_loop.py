"""Gains of the sampled current PI from steps of the demand (2010, section 3.1, Fig. 3).

Sampling, supply, anti-alias filter and anti-windup are those of the parameter set. The model
neglects the converter's resolution and treats its quantization error as noise.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from bywire.bench.experiment import as_run
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, state_at
from bywire.core.quantities import Current, Pressure, Torque, Unit
from bywire.identification.electrics import CurrentLoop, LoopOptions, levels
from bywire.simulation.run import simulate

if TYPE_CHECKING:
    import xarray as xr


class Options(LoopOptions):
    """Unknowns, torque that holds the rotor, and the synthetic experiment."""

    T_hold: Torque
    """torque that locks the model's rotor; must exceed the motor torque"""
    p_start: Pressure
    """synthetic: pressure that the stuck piston holds"""
    i_low: Current
    """synthetic: step size below the holding current, too small for breakaway"""
    i_high: Current
    """synthetic: step size above the holding current, too small for breakaway"""
    sigma_i: Annotated[float, Unit("A", 5e-3), Field(ge=0)]
    """synthetic: noise of the measured current, upstream of the converter"""


def held(par: MotorcycleParameters, options: Options) -> MotorcycleParameters:
    """Return the parameters with a rotor that seal friction locks."""
    return par.replace(
        {"drive.mode": "current-direct", "adc.law": "ideal", "seal.T_pr": options.T_hold}
    )


def at_rest(par: MotorcycleParameters) -> tuple[Any, Any]:
    """Return state and memory at the start of a record: no pressure in the chamber."""
    return state_at(0.0, par), memory_at(0.0, par)


LOOP = CurrentLoop(
    model=MotorcycleBrake(),
    demand="i_set",
    current="i",
    computed="i_meas",
    gains=("ecu.current.k_p", "ecu.current.k_i"),
    winding=("motor.R_m", "motor.L_m"),
    held=held,
    rest=at_rest,
)


def synthetic(par: MotorcycleParameters, options: Options, seed: int) -> xr.Dataset:
    """Return simulated demand steps of the whole brake, with a stuck piston and noisy feedback."""
    span = par.current_sensor.i_high - par.current_sensor.i_low
    noisy_par = par.replace({"adc.noise": options.sigma_i / span})
    hold = holding_current(options.p_start, noisy_par)
    T = noisy_par.ecu.T_s
    demand = levels(
        hold - options.i_low, hold + options.i_high, options.duration, options.dwell, T, seed=1
    )
    case = case_from_rest(
        "run",
        noisy_par,
        "current-direct",
        options.p_start,
        lambda t: {"i_set": demand(t)},
        options.duration,
        record=T,
    )
    computed = simulate(as_run(case, 20e-6, seed=(seed,)), ("i_meas",))
    time = np.asarray(computed.time)
    return LOOP.record(time, demand(time), computed["i_meas"], "measured current")


METHOD = LOOP.method(
    name="current-loop",
    assembly="motorcycle-brake",
    summary="gains of the current PI from steps with a locked rotor (Fig. 3 of Dardanelli et al.)",
    experiment="current-step",
    options=Options,
    defaults=Options(
        unknowns="gains",
        lead=0.1,
        T_hold=10.0,
        p_start=20e5,
        i_low=0.7,
        i_high=2.0,
        dwell=0.02,
        duration=2.0,
        sigma_i=1e-2,
    ),
    synthetic=synthetic,
    simulated=("p_start", "i_low", "i_high", "dwell", "duration", "sigma_i"),
)
