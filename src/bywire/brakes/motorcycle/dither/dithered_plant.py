"""From current demand to pressure under dither: the gain that friction leaves of the plant's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bywire.analysis.loop import Point
from bywire.analysis.periodic import PeriodicModel, periodic_model, require_moving
from bywire.brakes.motorcycle.ecu import Stimulus
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, state_at
from bywire.core.errors import SolverError
from bywire.core.signals import zeros

Par = MotorcycleParameters

_DEAD, _NEUTRAL = 1e-12, 1e-6  # poles that are gone after a period, and those of what is kept
_ROUNDS, _CLOSE = 12, 1e-4  # corrections of the current, and what counts as the pressure wanted


@dataclass(frozen=True, eq=False)
class DitheredPlant:
    """The plant about its motion under dither, current loop closed, pressure loop open.

    ``i``: mean current demand [A]; ``model``: from ``i_set`` to ``p_mc``.
    """

    i: float
    model: PeriodicModel

    @property
    def gain(self) -> float:
        """Change of the mean pressure over that of the current demand [Pa/A]."""
        return self.model.steady_gain

    @property
    def slowest(self) -> float:
        """Rate of the slowest decay over 2 pi [Hz]: the plant's first pole."""
        size = np.abs(self.model.averaged.poles())
        moving = size[(size > _DEAD) & (size < 1.0 - _NEUTRAL)]
        return float(-np.log(moving.max()) / (2.0 * np.pi * self.model.run.duration))


def dithered_plant(par: Par, p: float, step: float | None = None) -> DitheredPlant:
    """Return the linear model from current demand to pressure at a mean pressure under dither.

    Seals that rub more while applying than while releasing shift the mean pressure: the current
    that holds it is found by Newton's iteration with the model's own gain.

    Parameters
    ----------
    par
        Parameters; drive mode and converter do not matter.
    p
        Mean pressure [Pa], > 0.
    step
        Substep [s]; see `periodic.STEPS`.

    Raises
    ------
    SolverError
        When no motion repeats itself, or none has this mean pressure: where the dither leaves
        the piston stuck, pressure does not follow the current.
    """
    driven = par.replace({"drive.mode": "current", "adc.law": "ideal"})
    dither = driven.ecu.dither
    whole = () if dither.waveform == "off" else (dither.f_dit,)
    i = holding_current(p, driven)
    for _ in range(_ROUNDS):
        stimulus = zeros(Stimulus)._replace(i_set=i)
        state, memory = state_at(p, driven), memory_at(p, driven)
        start = Point(MotorcycleBrake(), driven, state, memory, stimulus)
        model = periodic_model(start, ("i_set",), "p_mc", whole, step)
        require_moving(model)
        gain = model.steady_gain  # negative or zero: the orbit is not the one that attracts
        if not gain > 0.0:
            break
        if abs(model.mean - p) <= _CLOSE * p:
            return DitheredPlant(i, model)
        i += (p - model.mean) / gain
    raise SolverError(
        f"no current demand near {i:.4g} A holds a mean pressure of {p / 1e5:g} bar under dither: "
        "the piston sticks there; raise ecu.dither.gain"
    )
