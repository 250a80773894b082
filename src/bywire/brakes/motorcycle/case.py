"""Starts of the motorcycle brake's runs: at rest at a pressure, or settled under dither."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.bench.experiment import Case, check_memory
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import DriveMode, MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, resting_at, state_at
from bywire.core.errors import SolverError
from bywire.core.interrupts import interrupts_deferred
from bywire.simulation.engine import prepare
from bywire.simulation.run import Run, simulate

Signals = Mapping[str, NDArray[np.float64]]


def case_from_rest(
    label: str,
    par: MotorcycleParameters,
    mode: DriveMode,
    p_start: float,
    stimulus: Callable[[NDArray[np.float64]], Signals],
    duration: float,
    changes: Mapping[str, Any] | None = None,
    **timing: float,
) -> Case:
    """Return a run that starts in equilibrium.

    ``mode``: quantity that the stimulus commands; ``p_start``: pressure at the start [Pa];
    ``changes``: other parameters that the experiment sets; ``timing``: ``settle``, ``keep`` and
    ``record`` of the case [s].
    """
    changed = par.replace({"drive.mode": mode, **(changes or {})})
    return Case(
        label=label,
        model=MotorcycleBrake(),
        par=changed,
        state=state_at(p_start, changed),
        memory=memory_at(p_start, changed),
        stimulus=stimulus,
        duration=duration,
        start=lambda par: (resting_at(p_start, par), memory_at(p_start, par)),
        **timing,
    )


def step_at_zero(
    name: str, before: float, after: float
) -> Callable[[NDArray[np.float64]], Signals]:
    """Return the stimulus that steps one signal at t = 0."""
    return lambda t: {name: np.where(t < -1e-9, before, after)}


def smoothing(par: MotorcycleParameters) -> dict[str, float]:
    """Return the default of the option ``smoothing``: one dither period [s]."""
    return {"smoothing": 1.0 / par.ecu.dither.f_dit}


# --- Settling under dither

_ROUNDS, _TOLERANCE = 12, 2e-3
_WINDOW = 0.2  # averaging window, as a fraction of the settling time
_SUBSTEPS, _LONGEST = 50, 20e-6  # minimum number of substeps per sample time; maximum substep [s]


def settled_start(p: float, par: MotorcycleParameters, settle: float) -> float:
    """Return the frictionless equilibrium [Pa] whose current lets the pressure settle at ``p``.

    With dither, the asymmetric friction shifts the mean pressure by several bar from the
    frictionless equilibrium. Each run over the settling time corrects the current by the
    pressure ratio of the previous run.

    ``p``: required mean pressure [Pa]; ``settle``: settling time [s] of a run.

    Raises
    ------
    SolverError
        When no current holds the pressure within 0.2 %, for example when the piston sticks.
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
        f"no current makes the dithered pressure settle at p_start = {p / 1e5:g} bar (last "
        f"value: {settled / 1e5:.4g} bar). Change p_start, increase settle, or set start = "
        "'frictionless'",
        name="p_start",
        value=f"{p / 1e5:g} bar",
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
