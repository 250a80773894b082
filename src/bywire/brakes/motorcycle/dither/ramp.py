"""Hysteresis loops of dithered brakes on the slow current ramp of eq. (17)."""

from __future__ import annotations

from collections.abc import Sequence

from bywire.bench.experiment import as_run
from bywire.bench.kpis.hysteresis import Loop, loop_area
from bywire.bench.kpis.smoothing import smoothed
from bywire.brakes.motorcycle.experiments import friction_ramp
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.simulation.ensemble import simulate_ensemble

Par = MotorcycleParameters

_STEP = 20e-6


def area_ratios(par: Par, designs: Sequence[tuple[float, float]]) -> list[float]:
    """Return the area of each design's loop of current over pressure, over that without dither.

    Loops are averaged over one dither period. Most of what is left is delay rather than friction,
    and shrinks with the ramp's slope.

    Parameters
    ----------
    designs
        Gain and frequency [Hz] of each dither.
    """
    options = friction_ramp.EXPERIMENT.defaults
    case = friction_ramp.cases(par, friction_ramp.Options.model_validate(options.model_dump()))[1]
    run = as_run(case, _STEP)
    every = [(0.0, designs[0][1]), *designs]
    changes = {
        "ecu.dither.gain": [gain for gain, _ in every],
        "ecu.dither.f_dit": [f for _, f in every],
    }
    found = simulate_ensemble(run, changes, ("i", "p_mc"))
    areas = []
    for k, (_, f) in enumerate(every):
        i, p = (smoothed(found.time, found[name][k], 1.0 / f) for name in ("i", "p_mc"))
        areas.append(loop_area(Loop(found.time, i, p)).value)
    return [area / areas[0] for area in areas[1:]]
