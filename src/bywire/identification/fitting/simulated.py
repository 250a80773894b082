"""A bench's own experiment, simulated with the noise of its sensors, in place of a record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.core.signals import Signal, signals_of
from bywire.identification.fitting.asked import Asked
from bywire.identification.fitting.options import Options
from bywire.identification.fitting.output_noise import noise_given
from bywire.identification.replaying.measured_run import case_of
from bywire.simulation.run import simulate


def simulated(bench: Bench, asked: Asked, options: Options, seed: int) -> xr.Dataset:
    """Return what drives the experiment and what is measured of it.

    Parameters
    ----------
    bench
        With the true values.
    asked
        Says which outputs, under which names the inputs, and how noisy the outputs are.
    options
        Their noise where it does not.
    seed
        Of the noise.

    Returns
    -------
    xarray.Dataset
        Over ``time`` [s], as far before zero as the experiment records.
    """
    bench = replace(bench, seed=seed)
    number = [one.label for one in bench.cases()].index(case_of(bench, asked.case).label)
    case = bench.cases()[number]
    run = as_run(case, bench.step, seed=(seed, number))
    made = simulate(run, tuple(asked.outputs))
    kept = made.time >= case.settle - case.keep - 1e-9
    t = np.round(made.time[kept] - case.settle, 12)
    random = np.random.default_rng([seed, 1])
    known = signals_of(run.model.Output)
    rows = {}
    for name, text in asked.outputs.items():
        values = made[name][kept]
        sigma = (
            noise_given(name, text, known[name].unit) if text
            else options.noise * float(np.ptp(values))
        )
        noisy = values + random.normal(0.0, sigma, values.size)
        rows[name] = ("time", noisy, _attrs(known[name]))
    stimuli, given = signals_of(run.model.Stimulus), case.stimulus(t)
    driven = asked.inputs or {n: n for n in given if not n.startswith("noise_")}
    for name, signal in driven.items():
        values = np.asarray(given.get(name, np.zeros(t.size)), dtype=float)
        rows[signal] = ("time", np.broadcast_to(values, t.shape), _attrs(stimuli[name]))
    axis = pd.Index(t, name="time")
    return xr.Dataset(rows, {"time": ("time", axis, {"units": "s", "long_name": "time"})})


def _attrs(signal: Signal) -> dict[str, str]:
    return {"units": signal.unit, "long_name": signal.label}
