"""Samples of signals: sums, moving averages, and defects that leave figures undefined.

The first functions are loops that run in Python, and that `bywire.bench.kpis.translator` translates
to C.
"""

from __future__ import annotations

from bisect import bisect_right
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.kpis.kpi import Undefined
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.quantities import readable_unit
from bywire.core.typing import Array
from bywire.core.units import shown

if TYPE_CHECKING:
    import xarray as xr

Samples = list[float]
"""samples of a signal, or their times"""


def total(y: Samples) -> float:
    """Sum of the samples in the order of time, because Python's `sum` differs between versions."""
    whole = 0.0
    for x in y:
        whole += x
    return whole


def integral(t: Samples, y: Samples) -> float:
    """Integral over time by the trapezoidal rule, which is exact for straight segments."""
    whole = 0.0
    for k in range(1, len(t)):
        whole += 0.5 * (y[k] + y[k - 1]) * (t[k] - t[k - 1])
    return whole


def value_at(t: Samples, y: Samples, instant: float) -> float:
    """Signal at a time, linear between samples and constant beyond the ends."""
    k = bisect_right(t, instant) - 1
    if k < 0:
        return y[0]
    if k == len(t) - 1 or t[k] == instant:
        return y[k]
    return (y[k + 1] - y[k]) / (t[k + 1] - t[k]) * (instant - t[k]) + y[k]


def moving_average(t: Samples, y: Samples, period: float) -> Samples:
    """Centered moving average over a period, equal to `bywire.bench.kpis.samples.smoothed`."""
    last = len(t) - 1
    width = min(period, t[last] - t[0])
    slope = [(y[k + 1] - y[k]) / (t[k + 1] - t[k]) for k in range(len(t) - 1)]
    primitive = [0.0] * len(t)
    for k in range(1, len(t)):
        primitive[k] = primitive[k - 1] + 0.5 * (y[k] + y[k - 1]) * (t[k] - t[k - 1])
    mean = [0.0] * len(t)
    i = 0  # intervals that contain the two ends of the period
    j = 0
    for k in range(len(t)):
        begin = min(max(t[k] - 0.5 * width, t[0]), t[last] - width)
        end = begin + width
        while i < last - 1 and t[i + 1] <= begin:
            i += 1
        while j < last - 1 and t[j + 1] <= end:
            j += 1
        d = begin - t[i]
        e = end - t[j]
        before = primitive[i] + y[i] * d + 0.5 * slope[i] * (d * d)
        mean[k] = (primitive[j] + y[j] * e + 0.5 * slope[j] * (e * e) - before) / width
    return mean


def defect_of_times(t: Samples) -> Undefined | None:
    """Reason why no figure is defined over these times; None for valid times."""
    if len(t) < 2:
        return Undefined(f"{len(t)} samples are too few: at least two are needed")
    wrong = 0  # no early exit, so that the loop vectorizes: almost all times are valid
    for k in range(1, len(t)):
        wrong += not t[k] > t[k - 1]
    if wrong > 0 or not isfinite(t[0]) or not isfinite(t[-1]):
        return Undefined("the times do not increase")
    return None


def defect_of_signal(t: Samples, y: Samples) -> Undefined | None:
    """Reason why no figure of a signal is defined; None for a valid signal."""
    wrong = 0
    for x in y:
        wrong += not isfinite(x)
    if wrong > 0:
        k = 0
        while isfinite(y[k]):
            k += 1
        return Undefined(f"not a number at {t[k]:g} s")
    return None


# --- Samples of a recording


def signal(recording: xr.Dataset, name: str) -> tuple[Array, str]:
    """Return one signal of a recording and its unit.

    Returns
    -------
    values
        Shape ``(time,)``; for the rows of many cases ``(cases, time)``.
    unit
        SI unit; ``"1"`` if none is recorded.

    Raises
    ------
    UnknownNameError
        When the recording does not contain the signal.
    ParameterError
        When the signal has other dimensions than time.
    """
    if name not in recording:
        raise unknown_name("signal of the recording", name, map(str, recording.variables))
    variable = recording[name]
    if variable.dims != ("time",):
        raise ParameterError(
            f"signal {name!r} has the dimensions {variable.dims}, but key figures need "
            "only the dimension time. Select one case first, for example recording.isel(case=0)",
            name=name,
            value=str(variable.dims),
            valid="time",
        )
    return np.asarray(variable.values, dtype=np.float64), str(variable.attrs.get("units", "1"))


def defect(t: Array, *signals: Array) -> str:
    """Return the reason why samples are not usable, or an empty text.

    Parameters
    ----------
    t
        Times [s], shape ``(n,)``.
    signals
        Signals over these times, shape ``(n,)`` each.
    """
    are_sound = all(y.shape == t.shape and np.isfinite(y).all() for y in (t, *signals))
    if are_sound and t.size > 1 and (t[1:] > t[:-1]).all():
        return ""  # the loops below take longer than the simulation of a long run
    times = t.tolist()
    wrong = defect_of_times(times)
    for values in signals:
        if values.shape != t.shape:
            return f"there are {values.size} values but {t.size} times"
        wrong = wrong or defect_of_signal(times, values.tolist())
    return "" if wrong is None else wrong.reason


# --- Moving average of arrays


def smoothed(t: Array, y: Array, period: float) -> Array:
    r"""Return the centered moving average over a period.

    .. math:: \bar y(t) = \frac{1}{T} \int_{c - T/2}^{c + T/2} y \, d\tau, \quad
              c = \min(\max(t, t_0 + T/2), t_1 - T/2)

    The signal is linear between samples and integrated exactly. A ripple of this period vanishes
    everywhere. There is no delay, but an edge spreads by half a period to both sides. This shortens
    a dead time and lengthens a rise time by up to half a period. Within half a period of either
    end, the result is the nearest full average, so a step should not be there.

    Parameters
    ----------
    t
        Times [s], increasing, shape ``(n,)``.
    y
        Signal, shape ``(..., n)``.
    period
        Averaging time T [s], at most the whole record; zero or less returns the signal itself.

    Returns
    -------
    numpy.ndarray
        Shape ``(..., n)``.
    """
    if period <= 0 or t.size < 2:
        return y
    width = min(period, float(t[-1] - t[0]))
    a = np.clip(t - 0.5 * width, t[0], t[-1] - width)
    slope = (y[..., 1:] - y[..., :-1]) / (t[1:] - t[:-1])
    pieces = 0.5 * (y[..., 1:] + y[..., :-1]) * np.diff(t)
    total = np.zeros(y.shape)
    np.cumsum(pieces, axis=-1, out=total[..., 1:])

    def primitive(at: Array) -> Array:
        """Return the integral of the piecewise linear signal from ``t[0]`` to each instant."""
        k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, t.size - 2)
        d = at - t[k]
        there, linear, bent = (np.take(each, k, axis=-1) for each in (total, y, slope))
        linear *= d
        bent *= 0.5
        bent *= d**2
        there += linear
        there += bent
        return there

    return np.asarray((primitive(a + width) - primitive(a)) / width)


def treatment(period: float) -> str:
    """Return the note on figures of a smoothed signal; empty for the raw one."""
    if not period > 0:
        return ""
    return f"moving average over {shown(period, 's', readable_unit(period, 's'))}"
