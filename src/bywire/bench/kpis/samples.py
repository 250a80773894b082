"""Samples of signals: how they come out of a recording, and whether they are sound."""

from __future__ import annotations

import numpy as np
import xarray as xr

from bywire.bench.kpis.loops import defect_of_signal, defect_of_times
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.typing import Array


def signal(recording: xr.Dataset, name: str) -> tuple[Array, str]:
    """Return one signal of a recording and its unit.

    Returns
    -------
    values
        Shape ``(time,)``; of the rows of many cases ``(cases, time)``.
    unit
        SI unit, ``"1"`` where none is recorded.

    Raises
    ------
    UnknownNameError
        When the recording does not hold the signal.
    ParameterError
        When the signal has other dimensions than time.
    """
    if name not in recording:
        raise unknown_name("signal of the recording", name, map(str, recording.variables))
    variable = recording[name]
    if variable.dims != ("time",):
        raise ParameterError(
            f"signal {name!r} has the dimensions {variable.dims}: key figures need time alone; "
            "select one case first, for instance recording.isel(case=0)"
        )
    return np.asarray(variable.values, dtype=np.float64), str(variable.attrs.get("units", "1"))


def defect(t: Array, *signals: Array) -> str:
    """Return why samples are unusable, or an empty text.

    Parameters
    ----------
    t
        Times [s], shape ``(n,)``.
    signals
        Signals over these times, shape ``(n,)`` each.
    """
    times = t.tolist()
    wrong = defect_of_times(times)
    for values in signals:
        if values.shape != t.shape:
            return f"{values.size} values do not fit {t.size} times"
        wrong = wrong or defect_of_signal(times, values.tolist())
    return "" if wrong is None else wrong.reason
