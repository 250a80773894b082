"""Dithers tried on the nonlinear brake: what friction is left, and what they cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bywire.bench.experiment import as_run
from bywire.bench.kpis.hysteresis import Loop, loop_area
from bywire.bench.kpis.smoothing import smoothed
from bywire.brakes.motorcycle.dither.reach import dead_band
from bywire.brakes.motorcycle.ecu import Stimulus
from bywire.brakes.motorcycle.experiments import friction_ramp
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.core.signals import zeros
from bywire.core.typing import Array
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run

Par = MotorcycleParameters

FIGURES = {
    "stuck": ("1", "share of the time stuck"),
    "band": ("1", "dead band left"),
    "ripple_sensor": ("Pa", "ripple at the sensor, p-p"),
    "ripple_caliper": ("Pa", "ripple at the caliper, p-p"),
    "current_rms": ("A", "dither's motor current, rms"),
    "copper": ("W", "dither's copper power"),
    "current_share": ("1", "peak of the current set point over the limit"),
    "duty_share": ("1", "peak of the duty cycle over its limit"),
}
"""unit and label of what a trial gives"""

_SIGNALS = ("i", "i_ref", "duty", "p_mc", "p_pd", "t_stuck", "E_copper")
_STEP = 20e-6


@dataclass(frozen=True)
class Trial:
    """How dithers are tried.

    ``settle``, ``window``: time [s] until the pressure loop has settled, and over which figures are
    taken, rounded down to whole periods of each dither; ``approach``: distance [Pa] from which the
    pressure is approached, from below and from above.
    """

    settle: float = 4.0
    window: float = 1.0
    approach: float = 2e5


def tried(
    par: Par, p: float, gains: Sequence[float], frequencies: Sequence[float], trial: Trial
) -> Mapping[str, Array]:
    """Return the figures of every dither at a pressure, pressure loop closed.

    The pressure controller takes the brake to the pressure from below, and from above. Where
    dither has overcome the friction, the mean current that holds the pressure is the same; what is
    left between the two, over the friction's dead band, is the hysteresis left.

    Parameters
    ----------
    p
        Pressure [Pa], > ``trial.approach``.
    gains, frequencies
        Of the dither's law; frequencies [Hz] with whole sample times in a period.

    Returns
    -------
    dict
        The variables of `FIGURES`, shape (gains, frequencies).

    Raises
    ------
    ParameterError
        When a pressure cannot be held, or a value is out of range.
    SolverError
        When a trajectory leaves the numbers.
    """
    controlled = par.replace({"drive.mode": "pressure"})
    pairs = [(g, f) for g in gains for f in frequencies]
    both = [
        _measured(controlled, p, start, pairs, trial)
        for start in (p - trial.approach, p + trial.approach)
    ]
    apart = np.abs(both[1]["mean"] - both[0]["mean"]) / dead_band(controlled, p)
    worse = {name: np.fmax(both[0][name], both[1][name]) for name in FIGURES if name != "band"}
    shape = (len(gains), len(frequencies))
    return {name: value.reshape(shape) for name, value in {**worse, "band": apart}.items()}


def _measured(
    par: Par, p: float, start: float, pairs: Sequence[tuple[float, float]], trial: Trial
) -> dict[str, Array]:
    """Return the figures of all dithers after an approach from one side, shape (cases,) each."""
    row = [float(value) for value in zeros(Stimulus)._replace(p_set=p)]
    T = par.ecu.T_s
    run = Run(
        MotorcycleBrake(),
        par,
        state_at(start, par),
        memory_at(start, par),
        lambda t: np.repeat([row], t.size, axis=0),
        trial.settle + trial.window,
        _STEP,
        T,
    )
    gains, frequencies = (np.array(values) for values in zip(*pairs, strict=True))
    ensemble = simulate_ensemble(
        run, {"ecu.dither.gain": gains, "ecu.dither.f_dit": frequencies}, _SIGNALS
    )
    figures = [
        _figures(par, ensemble.values[k], max(int(trial.window * f), 1), round(1.0 / (f * T)))
        for k, f in enumerate(frequencies)
    ]
    return {name: np.array([case[name] for case in figures]) for name in figures[0]}


def _figures(par: Par, values: Array, periods: int, samples: int) -> dict[str, float]:
    """Return the figures of the last periods of a run, each of so many samples."""
    count = periods * samples
    late = dict(zip(_SIGNALS, values[-count - 1 :].T, strict=True))
    duration = count * par.ecu.T_s
    whole = {name: value[:-1] for name, value in late.items()}
    mean = float(whole["i"].mean())
    copper = float(late["E_copper"][-1] - late["E_copper"][0]) / duration
    extra = max(copper - par.motor.R_m * mean**2, 0.0)
    return {
        "mean": mean,
        "stuck": float(late["t_stuck"][-1] - late["t_stuck"][0]) / duration,
        "ripple_sensor": _ripple(whole["p_mc"], samples),
        "ripple_caliper": _ripple(whole["p_pd"], samples),
        "current_rms": float(np.sqrt(extra / par.motor.R_m)),
        "copper": extra,
        "current_share": float(np.abs(whole["i_ref"]).max()) / par.ecu.pressure.i_max,
        "duty_share": float(np.abs(whole["duty"]).max()) / par.ecu.current.D_max,
    }


def _ripple(pressure: Array, samples: int) -> float:
    """Return the dither's ripple: what a pressure spans within a period, the median of all.

    Where dither is too weak to free the piston, the controller's integral part does it now and
    then; that jump is no ripple.
    """
    return float(np.median(np.ptp(pressure.reshape(-1, samples), axis=1)))


def area_ratios(par: Par, designs: Sequence[tuple[float, float]]) -> list[float]:
    """Return the area of each design's loop of current over pressure, over that without dither.

    Loops are averaged over one dither period. Most of what is left is delay rather than friction,
    and shrinks with the ramp's slope.

    ``designs``: gain and frequency [Hz] of each dither.
    """
    options = friction_ramp.EXPERIMENT.defaults
    case = friction_ramp.cases(par, friction_ramp.Options.model_validate(options.model_dump()))[1]
    run = as_run(case, _STEP)
    every = [(0.0, designs[0][1]), *designs]
    changes = {
        "ecu.dither.gain": [gain for gain, _ in every],
        "ecu.dither.f_dit": [f for _, f in every],
    }
    ensemble = simulate_ensemble(run, changes, ("i", "p_mc"))
    areas = []
    for k, (_, f) in enumerate(every):
        i, p = (smoothed(ensemble.time, ensemble[name][k], 1.0 / f) for name in ("i", "p_mc"))
        areas.append(loop_area(Loop(ensemble.time, i, p)).value)
    return [area / areas[0] for area in areas[1:]]
