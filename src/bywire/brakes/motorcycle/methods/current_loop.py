"""Gains of the sampled current PI from steps of the demand (2010, section 3.1, Fig. 3)."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.bench.experiment import as_run
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, state_at
from bywire.core.quantities import Current, Pressure, Torque, Unit
from bywire.identification.electrics.loop_records import (
    LoopOptions,
    identified_loop,
    levels,
    noise_of_levels,
    require_steps,
    without_lead,
)
from bywire.identification.measured import split
from bywire.identification.method import Effort, Identified, Method
from bywire.identification.output_error import Trial, trial
from bywire.simulation.run import simulate

_GAINS = ("ecu.current.k_p", "ecu.current.k_i")
_WINDING = ("motor.R_m", "motor.L_m")


class Options(LoopOptions):
    """What is unknown, how the rotor is held, and the synthetic experiment."""

    T_hold: Torque
    """torque by which the model's rotor is held: more than the motor has"""
    p_start: Pressure
    """synthetic: pressure that the stuck piston holds"""
    i_low: Current
    """synthetic: how far steps go below the holding current, within breakaway"""
    i_high: Current
    """synthetic: how far they go above it"""
    sigma_i: Annotated[float, Unit("A", 5e-3), Field(ge=0)]
    """synthetic: noise of the measured current, ahead of the converter"""


def identify(
    data: xr.Dataset, par: MotorcycleParameters, options: Options, effort: Effort
) -> Identified:
    """Return k_p and k_i of the current PI.

    The loop is run over the measured demand, rotor locked, and fitted to the measured current:
    sampling, supply, anti-alias filter and anti-wind-up as in the parameter set. The converter's
    resolution is left out; its error counts as noise.

    Parameters
    ----------
    data
        ``i_set``: set point of the current PI [A]; ``i``: current as the ECU measures it [A]; both
        logged at its ticks, the rotor locked or stuck under pressure. One or several records.

    Raises
    ------
    ParameterError
        When the demand does not step, or nothing can be estimated.

    Notes
    -----
    From demand to current only k_p V/L_m, k_i V/L_m and R_m/L_m show: with all four unknown, the
    one that the data tells least keeps its value, and is named.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), section 3.1, Fig. 3.
    """
    trials = [_trial(record, par, options, label) for label, record in split(data).items()]
    return identified_loop(trials, par, options.names(_GAINS, _WINDING))


def _trial(data: xr.Dataset, par: MotorcycleParameters, options: Options, label: str) -> Trial:
    require_steps(data, "i_set", "i", label)
    loop_par = par.replace(
        {"drive.mode": "current-direct", "adc.law": "ideal", "seal.T_pr": options.T_hold}
    )
    i = data["i"].values
    sigma = noise_of_levels(i, data["i_set"].values)
    beside = trial(
        MotorcycleBrake(),
        loop_par,
        data.assign(i_meas=("time", i)),
        {"i_set": "i_set"},
        {"i_meas": sigma},
        state=state_at(0.0, loop_par),
        memory=memory_at(0.0, loop_par),
        label=label,
    )
    return without_lead(beside, data, options.lead)


def synthetic(par: MotorcycleParameters, options: Options, seed: int) -> xr.Dataset:
    """Return steps of the demand on the whole brake, the piston stuck, with noise in the loop."""
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
    return xr.Dataset(
        {
            "i_set": ("time", demand(computed.time), {"units": "A", "long_name": "current demand"}),
            "i": ("time", computed["i_meas"], {"units": "A", "long_name": "measured current"}),
        },
        {"time": ("time", np.asarray(computed.time), {"units": "s", "long_name": "time"})},
    )


METHOD = Method(
    name="current-loop",
    assembly="motorcycle-brake",
    summary="gains of the current PI from steps, rotor locked (2010, section 3.1, Fig. 3)",
    experiment="current-step",
    signals={"i_set": "A", "i": "A"},
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
    identify=identify,
    synthetic=synthetic,
    unknowns=_GAINS,
    several=True,
    simulated=("p_start", "i_low", "i_high", "dwell", "duration", "sigma_i"),
)
