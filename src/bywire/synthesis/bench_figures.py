"""What gains are worth on the nonlinear bench: sines by amplitude, and the brake's step.

Many sets of gains run side by side, in the lanes of one ensemble. A set is measured in stages, and
left where what is known of it already says that it is not wanted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from bywire.analysis.loop import Loop
from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.bench.kpis.registry import evaluate
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of
from bywire.simulation.ensemble import simulate_ensemble
from bywire.synthesis.bench_sines import Sines, Small

STEP_FIGURES = ("overshoot", "settling_time", "steady_state_error")


@dataclass(frozen=True)
class BenchFigures:
    """One set of gains on the nonlinear bench, or what is known of it so far.

    Parameters
    ----------
    small
        By amplitude.
    step
        Overshoot [%], settling time [s] and steady-state error [% of the step] of the loop's
        experiment; empty where it has no step response. NaN where not defined.
    reasons
        Why a figure of the step is not defined, by its name.
    """

    small: tuple[Small, ...]
    step: Mapping[str, float]
    reasons: Mapping[str, str] = field(default_factory=dict)


Worth = Callable[[int, BenchFigures], bool]
"""``worth(k, figures) -> bool``: whether set k, with what is known of it so far, is measured on"""


def bench_figures(
    loop: Loop,
    par: ParameterSet,
    value: float,
    amplitudes: Sequence[float],
    gains: Mapping[str, Sequence[float]],
    bench: Bench | None,
    target: float,
) -> tuple[BenchFigures, ...]:
    """Return the figures of several sets of gains.

    Parameters
    ----------
    loop, par, value
        Loop, parameters and operating point, friction, dither and limits on; the loop's
        ``sustained`` are set for the sines.
    amplitudes
        Of the sines, SI.
    gains
        Dotted name -> its value in each set [SI].
    bench
        The experiment whose step is judged; None for none.
    target
        Frequency around which is measured [Hz], from a quarter to three times of it.
    """
    everything = wanted_figures(
        loop, par, value, amplitudes, gains, bench, target, lambda k, known: True
    )
    return tuple(figures for figures in everything if figures is not None)


def wanted_figures(
    loop: Loop,
    par: ParameterSet,
    value: float,
    amplitudes: Sequence[float],
    gains: Mapping[str, Sequence[float]],
    bench: Bench | None,
    target: float,
    worth: Worth,
    *,
    rough: bool = False,
) -> tuple[BenchFigures | None, ...]:
    """Return the figures of those of several sets of gains that are worth to be measured.

    The step is cheap and comes first; then the sines next to the target, of which only the
    smallest gain is known so far; then all others.

    Parameters
    ----------
    loop, par, value, amplitudes, gains, bench, target
        As of `bench_figures`.
    worth
        Asked before every stage but the first. Unknown figures are NaN, or not there.
    rough
        Whether settling to 0.5 % is enough, as in a search.

    Returns
    -------
    tuple
        None for the sets that were left.
    """
    steps = _steps(bench, gains) if bench is not None else None
    sines = Sines(loop, par, value, amplitudes, gains, target, rough=rough)

    def known(k: int, small: tuple[Small, ...] = ()) -> BenchFigures:
        return BenchFigures(small, *(({},) if steps is None else steps[k]))

    sets = len(next(iter(gains.values())))
    wanted = [k for k in range(sets) if worth(k, known(k))]
    sines.measure(wanted, sines.near)
    wanted = [k for k in wanted if worth(k, known(k, sines.first_look(k)))]
    sines.measure(wanted, sines.others)
    figures = {k: known(k, sines.figures(k)) for k in wanted}
    return tuple(figures.get(k) for k in range(sets))


def has_step(bench: Bench) -> bool:
    """Return whether an experiment has one run and a step that it is judged by."""
    return bench.definition.step is not None and len(bench.cases()) == 1


def _steps(
    bench: Bench, gains: Mapping[str, Sequence[float]]
) -> list[tuple[dict[str, float], dict[str, str]]] | None:
    """Return the step's figures for every set of gains, and why some are not defined."""
    definition = bench.definition
    if definition.step is None or not has_step(bench):
        return None
    (case,) = bench.cases()
    setting = definition.step(bench.chosen_options)
    run = as_run(case, bench.step, seed=(bench.seed, 0))
    kept = {name: np.asarray(values, dtype=float) for name, values in gains.items()}
    ensemble = simulate_ensemble(run, kept, [setting.signal])
    unit = signals_of(case.model.Output)[setting.signal].unit
    height = abs((setting.end or 0.0) - (setting.start or 0.0))
    rows = []
    for values in ensemble[setting.signal]:
        recording = xr.Dataset(
            {setting.signal: ("time", values, {"units": unit})},
            coords={"time": ("time", ensemble.time - case.settle, {"units": "s"})},
        )
        kpis = evaluate("step_response", recording, setting)
        row = {name: kpis[name].value for name in STEP_FIGURES}
        row["steady_state_error"] *= 100.0 / height if height else math.nan
        missing = [name for name in STEP_FIGURES if math.isnan(row[name])]
        rows.append((row, {n: kpis[n].note or "the step has no height" for n in missing}))
    return rows
