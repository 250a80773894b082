"""Current-loop gains of a drive from steps of a clamped motor (2003, "Motor current loop")."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from bywire.bench.experiment import as_run
from bywire.brakes.wedge.case import check_current, shaft_case
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig
from bywire.core.quantities import Current, Duration, Unit
from bywire.identification.electrics import CurrentLoop, LoopOptions, levels
from bywire.simulation.run import simulate

if TYPE_CHECKING:
    import xarray as xr

_CLAMPED = {"rig.load": "dummy", "rig.clamp": "closed", "rig.mode_1": "current"}


class Options(LoopOptions):
    """Unknowns, and the synthetic experiment."""

    i_step: Current
    """synthetic: maximum demand"""
    interval: Duration
    """synthetic: sample time"""
    sigma_i: Annotated[float, Unit("A", 2e-2), Field(ge=0)]
    """synthetic: current noise"""


def held(par: WedgeParameters, _: Options) -> WedgeParameters:
    """Return the parameters with the shaft clamped."""
    return par.replace({**_CLAMPED, "encoder.law": "ideal"})


LOOP = CurrentLoop(
    model=ShaftRig(),
    demand="i_1_set",
    current="i_1",
    computed="i_1",
    gains=("drive.k_p", "drive.k_i"),
    winding=("motor_1.R_ref", "motor_1.L_M"),
    held=held,
)


def synthetic(par: WedgeParameters, options: Options, seed: int) -> xr.Dataset:
    """Return simulated demand steps on the rig with one motor, with sensor noise."""
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
    time = np.asarray(computed.time)
    noise = np.random.default_rng(seed).normal(0.0, options.sigma_i, time.size)
    return LOOP.record(time, demand(time), computed["i_1"] + noise, "motor current")


METHOD = LOOP.method(
    name="drive-current-loop",
    assembly="wedge-brake",
    summary="current-loop gains of a drive from steps with the motor clamped, as in Roberts et al.",
    experiment="current-loop",
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
    synthetic=synthetic,
    simulated=("i_step", "dwell", "duration", "interval", "sigma_i"),
)
