"""Gains of a drive's current loop from steps of a clamped motor (2003, "Motor current loop")."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.bench.experiment import as_run
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_case import check_current, shaft_case
from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig
from bywire.core.quantities import Current, Duration, Unit
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

_GAINS = ("drive.k_p", "drive.k_i")
_WINDING = ("motor_1.R_ref", "motor_1.L_M")
_CLAMPED = {"rig.load": "dummy", "rig.clamp": "closed", "rig.mode_1": "current"}


class Options(LoopOptions):
    """What is unknown, and the synthetic experiment."""

    i_step: Current
    """synthetic: largest demand"""
    interval: Duration
    """synthetic: sample time"""
    sigma_i: Annotated[float, Unit("A", 2e-2), Field(ge=0)]
    """synthetic: noise of the measured current"""


def identify(
    data: xr.Dataset, par: WedgeParameters, options: Options, effort: Effort
) -> Identified:
    """Return k_p and k_i of a drive's current loop.

    Parameters
    ----------
    data
        ``i_1_set``: current demand [A], ``i_1``: motor current [A], the shaft clamped. One or
        several records.

    Raises
    ------
    ParameterError
        When the demand does not step, or nothing can be estimated.

    Notes
    -----
    From demand to current only k_p V/L_M, k_i V/L_M and R_M/L_M show: with all four unknown, the
    one that the data tells least keeps its value, and is named.

    References
    ----------
    Roberts et al. (2003), sections "Current controller" and "Motor current loop".
    """
    trials = [_trial(record, par, options, label) for label, record in split(data).items()]
    return identified_loop(trials, par, options.names(_GAINS, _WINDING))


def _trial(data: xr.Dataset, par: WedgeParameters, options: Options, label: str) -> Trial:
    require_steps(data, "i_1_set", "i_1", label)
    clamped_par = par.replace({**_CLAMPED, "encoder.law": "ideal"})
    sigma = noise_of_levels(data["i_1"].values, data["i_1_set"].values)
    beside = trial(
        ShaftRig(), clamped_par, data, {"i_1_set": "i_1_set"}, {"i_1": sigma}, label=label
    )
    return without_lead(beside, data, options.lead)


def synthetic(par: WedgeParameters, options: Options, seed: int) -> xr.Dataset:
    """Return steps of the demand on the rig of one motor, simulated, with the sensor's noise."""
    check_current("i_step", options.i_step, par)
    T = par.control.T_fast
    demand = levels(-options.i_step, options.i_step, options.duration, options.dwell, T, seed=1)
    case = shaft_case(
        "run",
        par,
        lambda t: {"i_1_set": demand(t)},
        options.duration,
        _CLAMPED,
        record=options.interval,
    )
    computed = simulate(as_run(case, 20e-6), ("i_1",))
    noise = np.random.default_rng(seed).normal(0.0, options.sigma_i, computed.time.size)
    return xr.Dataset(
        {
            "i_1_set": (
                "time",
                demand(computed.time),
                {"units": "A", "long_name": "current demand"},
            ),
            "i_1": ("time", computed["i_1"] + noise, {"units": "A", "long_name": "motor current"}),
        },
        {"time": ("time", np.asarray(computed.time), {"units": "s", "long_name": "time"})},
    )


METHOD = Method(
    name="drive-current-loop",
    assembly="wedge-brake",
    summary="gains of a drive's current loop from steps, motor clamped (2003, current loop)",
    experiment="current-loop",
    signals={"i_1_set": "A", "i_1": "A"},
    options=Options,
    defaults=Options(
        unknowns="gains",
        lead=2e-3,
        i_step=5.0,
        dwell=2e-3,
        duration=0.1,
        interval=2e-5,
        sigma_i=2e-2,
    ),
    identify=identify,
    synthetic=synthetic,
    unknowns=_GAINS,
    several=True,
    simulated=("i_step", "dwell", "duration", "interval", "sigma_i"),
)
