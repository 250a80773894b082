"""Runs from rest and changed parameters for the tests of the rigs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.screw_rig import ScrewRig
from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig
from bywire.core.catalog import parameters
from bywire.core.signals import zeros
from bywire.simulation.run import Run, Trajectory, simulate

Array = NDArray[np.float64]

SLOPE = 2e-3 / (2.0 * math.pi)
FRICTIONLESS = {
    "encoder.law": "ideal",
    "bearing.C_0": 0.0,
    "bearing.C_2": 0.0,
    "bearing.T_nu": 0.0,
    "screw.eta_f": 1.0,
    "screw.eta_b": 1.0,
    "motor_1.T_cog": 0.0,
    "motor_2.T_cog": 0.0,
    "motor_1.D_M": 0.0,
    "motor_2.D_M": 0.0,
}


def rig(changes: Mapping[str, Any] | None = None) -> WedgeParameters:
    """Return the parameters of the paper's brake, ideal encoders, with changes."""
    par = parameters("roberts2003")
    assert isinstance(par, WedgeParameters)
    return par.replace({"encoder.law": "ideal", **(changes or {})})


def drive(
    model: ShaftRig | ScrewRig,
    par: WedgeParameters,
    duration: float,
    step: float = 20e-6,
    record: float = 1e-3,
    state: Mapping[str, float] | None = None,
    **stimulus: Callable[[Array], Array],
) -> Trajectory:
    """Return a run from rest, some states changed, under some stimuli of time."""
    fields = model.Stimulus._fields

    def rows(t: Array) -> Array:
        found = np.zeros((t.size, len(fields)))
        for name, signal in stimulus.items():
            found[:, fields.index(name)] = signal(t)
        return found

    start = zeros(model.State)._replace(**(state or {}))
    memory = zeros(model.Memory)
    trajectory = simulate(Run(model, par, start, memory, rows, duration, step, record))
    assert trajectory.status == "done"
    assert trajectory.unsettled == 0
    return trajectory


def emf_inertia(par: WedgeParameters) -> float:
    """Return the inertia [kg m^2] that the back-EMF seems to add to a slow motion.

    The current controller's integral term must follow the EMF: an error of K_T / (V k_i) times
    the acceleration remains, and the torque of that current is missing.
    """
    return par.motor_1.K_ref**2 / (par.drive.V_dc * par.drive.k_i)


def residual(run: Trajectory) -> Array:
    """Return what the energy balance leaves unexplained [J], shape (rows,)."""
    losses = [n for n in run.names if n.startswith("E_") and n not in ("E_source", "E_stored")]
    left = run["E_source"] - run["E_stored"] - sum(run[name] for name in losses)
    return np.asarray(left - left[0])
