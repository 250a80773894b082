"""Samples of signals, time last: how they come out of a recording, and what they add up to."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

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
        Signals over these times, shape ``(..., n)`` each.
    """
    if t.size < 2:
        return f"{t.size} samples are too few: two at least are needed"
    if not np.all(np.isfinite(t)) or np.any(np.diff(t) <= 0):
        return "the times do not increase"
    for values in signals:
        if values.shape[-1:] != t.shape:
            return f"{values.size} values do not fit {t.size} times"
        sound = np.isfinite(values)
        if not sound.all():
            return f"not a number at {t[np.argwhere(~sound)[:, -1].min()]:g} s"
    return ""


def integral(t: Array, y: Array) -> Array:
    """Return the integral over time by the trapezoidal rule, exact for straight pieces.

    ``t``, ``y``: shapes ``(n,)`` and ``(..., n)``; the integral has ``(...)``.
    """
    return total(0.5 * (y[..., 1:] + y[..., :-1]) * np.diff(t))


def total(y: Array) -> Array:
    """Return the sum of the samples in the order of time, so that every machine rounds alike.

    ``y``: shape ``(..., n)``, n >= 1; the sum has ``(...)``.
    """
    return np.asarray(np.cumsum(y, axis=-1)[..., -1])


def sample(y: Array, k: NDArray[np.integer[Any]]) -> Array:
    """Return the sample of each case at its index; shapes ``(..., n)`` and ``(...)``."""
    return np.asarray(np.take_along_axis(y, k[..., None], axis=-1)[..., 0])
