"""Runs from the parking position and changed parameters for the wedge brake's tests."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.brakes.wedge.model import WedgeBrake, memory_at, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters
from bywire.simulation.run import Run, Trajectory, simulate

Array = NDArray[np.float64]

TAN_ALPHA = math.tan(math.radians(20.0))
IDEAL = {"encoder.law": "ideal"}
FRICTIONLESS = IDEAL | {
    "bearing.C_0": 0.0,
    "bearing.C_2": 0.0,
    "bearing.T_nu": 0.0,
    "screw.eta_f": 1.0,
    "screw.eta_b": 1.0,
    "wedge_friction.mu_int": 0.0,
    "wedge_friction.mu_R": 0.0,
    "flywheel.runout": 0.0,
    "flywheel.law": "driven",
    "motor_1.T_cog": 0.0,
    "motor_2.T_cog": 0.0,
}


def brake(changes: Mapping[str, Any] | None = None, mu_B: float = 0.35) -> WedgeParameters:
    """Return the changed parameters of the paper's brake, with mu_B in the controller."""
    par = parameters("roberts2003")
    assert isinstance(par, WedgeParameters)
    slope = par.control.moment.slope_hat * mu_B / 0.35
    known = {"wedge.mu_B": mu_B, "control.moment.slope_hat": slope}
    return par.replace(known | dict(changes or {}))


def drive(
    par: WedgeParameters,
    duration: float,
    step: float = 20e-6,
    record: float = 1e-3,
    state: Any | None = None,
    **stimulus: Callable[[Array], Array],
) -> Trajectory:
    """Return a run from the parking position, or from a state, under some stimuli of time."""
    fields = WedgeBrake.Stimulus._fields

    def rows(t: Array) -> Array:
        found = np.zeros((t.size, len(fields)))
        for name, signal in stimulus.items():
            found[:, fields.index(name)] = signal(t)
        return found

    start = state_at(0.0, par) if state is None else state
    run = Run(WedgeBrake(), par, start, memory_at(start.x, par), rows, duration, step, record)
    trajectory = simulate(run)
    assert trajectory.status == "done"
    assert trajectory.unsettled == 0
    return trajectory


def residual(run: Trajectory) -> Array:
    """Return what the energy balance leaves unexplained [J], shape (rows,)."""
    losses = [n for n in run.names if n.startswith("E_") and n not in ("E_source", "E_stored")]
    left = run["E_source"] - run["E_stored"] - sum(run[name] for name in losses)
    return np.asarray(left - left[0])
