"""Simulated runs as a bench's sensors would show them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr

from bywire.bench.experiment import Case, as_run
from bywire.core.signals import signals_of
from bywire.data.labeled import labeled
from bywire.simulation.run import simulate

_STEP = 20e-6


@dataclass(frozen=True)
class Sensor:
    """What is read of a run.

    ``output``: output of the model; ``sigma``: standard deviation of white noise on every sample
    [unit of the output].
    """

    output: str
    sigma: float = 0.0


def sensed(case: Case, sensors: Mapping[str, Sensor], random: np.random.Generator) -> xr.Dataset:
    """Return one run's signals from time zero on, with noise.

    ``sensors``: signal -> what it reads; ``random``: where the noise comes from.
    """
    run = as_run(case, _STEP)
    computed = simulate(run, tuple({s.output for s in sensors.values()}))
    known = signals_of(run.model.Output)
    settled = run.duration - case.duration
    kept = computed.time >= settled - 1e-9
    axis = pd.Index(np.round(computed.time[kept] - settled, 12), name="time")
    rows = {}
    for name, sensor in sensors.items():
        values = computed[sensor.output][kept] + random.normal(0.0, sensor.sigma, int(kept.sum()))
        signal = known[sensor.output]
        rows[name] = (values, signal.unit, signal.label)
    return labeled({"time": (axis, "s", "time")}, rows)
