"""Simulated runs as a bench's sensors would show them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from bywire.bench.experiment import Case, as_run
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_case import slope_of
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.simulation.run import simulate

_STEP = 20e-6
_ANGLES = ("theta_", "last_")


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
        attrs = {"units": known[sensor.output].unit, "long_name": known[sensor.output].label}
        rows[name] = ("time", values, attrs)
    return xr.Dataset(rows, {"time": ("time", axis, {"units": "s", "long_name": "time"})})


def turned(case: Case, angle: float) -> Case:
    """Return a rig's run that begins at another angle of the shafts, everything else alike.

    Encoder counts and cogging then fall elsewhere, as they do on a bench from day to day.

    ``case``: of a rig, or of the wedge brake, whose wedge moves along; ``angle``: added to every
    shaft's angle [rad].
    """

    def shifted(row: Any) -> Any:
        names = [n for n in row._fields if n.startswith(_ANGLES)]
        row = row._replace(**{n: getattr(row, n) + angle for n in names})
        if "x" in row._fields and isinstance(case.par, WedgeParameters):
            row = row._replace(x=row.x + slope_of(case.par) * angle)
        return row

    def stimulus(t: Array) -> dict[str, Array]:
        given = dict(case.stimulus(t))
        return given | {n: v + angle for n, v in given.items() if n.startswith(_ANGLES)}

    return replace(case, state=shifted(case.state), memory=shifted(case.memory), stimulus=stimulus)
