"""What the motorcycle brake's experiments share: runs that start at rest at a pressure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.bench.experiment import Case
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import DriveMode, MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, resting_at, state_at

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

    ``mode``: what the stimulus commands; ``p_start``: pressure at the start [Pa]; ``changes``:
    further parameters that the experiment sets; ``timing``: ``settle``, ``keep`` and ``record`` of
    the case [s].
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
    """Return the option ``smoothing`` as it is unless given: one dither period [s]."""
    return {"smoothing": 1.0 / par.ecu.dither.f_dit}
