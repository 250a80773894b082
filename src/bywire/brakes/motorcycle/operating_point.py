"""Operating points of the dithered motorcycle brake: where the pressure settles."""

from __future__ import annotations

import math

import numpy as np

from bywire.bench.experiment import check_memory
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, state_at
from bywire.core.errors import SolverError
from bywire.core.interrupts import interrupts_deferred
from bywire.simulation.engine import prepare
from bywire.simulation.run import Run, simulate

_ROUNDS, _TOLERANCE = 12, 2e-3
_WINDOW = 0.2  # of the settling time: the mean is taken over it
_SUBSTEPS, _LONGEST = 50, 20e-6  # substeps per sample time at least, and their longest length [s]


def settled_start(p: float, par: MotorcycleParameters, settle: float) -> float:
    """Return the frictionless equilibrium [Pa] whose current lets the pressure settle at ``p``.

    Under dither the asymmetric friction shifts the mean pressure by several bar from the
    equilibrium without friction. The current is found by runs of the settling time, each
    corrected by the ratio of the last.

    ``p``: mean pressure wanted [Pa]; ``settle``: settling time [s] of a run.

    Raises
    ------
    SolverError
        When no current does, within 0.2 % of the pressure: for instance when it sticks.
    """
    start = p
    for _ in range(_ROUNDS):
        settled = _settled(start, par, settle)
        if abs(settled - p) <= _TOLERANCE * p:
            return start
        if settled <= 0.05 * p:
            break
        start *= p / settled
    raise SolverError(
        f"no current lets the dithered pressure settle at {p / 1e5:g} bar (last: "
        f"{settled / 1e5:.4g} bar): take another p_start, a longer settle, or start = "
        "'frictionless'"
    )


def _settled(start: float, par: MotorcycleParameters, settle: float) -> float:
    """Return the mean pressure [Pa] at the end of a run with constant current demand."""
    driven = par.replace({"drive.mode": "current"})
    i = holding_current(start, driven)
    fields = MotorcycleBrake.Stimulus._fields

    def stimulus(t: np.ndarray) -> np.ndarray:
        rows = np.zeros((t.size, len(fields)))
        rows[:, fields.index("i_set")] = i
        return rows

    T = driven.ecu.T_s
    step = T / max(_SUBSTEPS, math.ceil(T / _LONGEST - 1e-9))
    x, m = state_at(start, driven), memory_at(start, driven)
    run = Run(MotorcycleBrake(), driven, x, m, stimulus, settle, step=step, record=T)
    check_memory(run, 1)
    with interrupts_deferred():
        prepare(run.model, run.par).engine()
    trajectory = simulate(run, ("p_mc",))
    if trajectory.status == "interrupted":
        raise KeyboardInterrupt
    late = trajectory.time >= (1.0 - _WINDOW) * settle
    return float(trajectory["p_mc"][late].mean())
