"""Runs that start at rest at a clamp force, for all experiments."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from bywire.authoring import Case
from emb_caliper.parameters import BrakeParameters, DriveMode
from emb_caliper.trim import brake_with, memory_at, state_at

Array = NDArray[np.float64]


def case_from_rest(
    par: BrakeParameters,
    drive: DriveMode,
    F: float,
    stimulus: Callable[[Array], Mapping[str, Array]],
    duration: float,
    label: str = "run",
    **timing: float,
) -> Case:
    """Return a run that starts in equilibrium at a clamp force.

    Parameters
    ----------
    par
        Parameters, except ``drive``.
    drive
        Quantity that the stimulus commands.
    F
        Initial clamp force [N]; 0 for the parked piston.
    stimulus, duration, label
        As in `Case`.
    timing
        ``settle``, ``keep`` and ``record`` of the case [s].
    """
    driven = par.replace({"drive": drive})
    return Case(
        label,
        brake_with(driven),
        driven,
        state_at(F, driven),
        memory_at(F, driven),
        stimulus,
        duration,
        start=lambda par: (state_at(F, par), memory_at(F, par)),
        **timing,
    )


def step_at_zero(name: str, before: float, after: float) -> Callable[[Array], Mapping[str, Array]]:
    """Return the stimulus that steps one signal at t = 0."""
    return lambda t: {name: np.where(t < -1e-9, before, after)}
