"""Loops over samples that families of key figures share.

Python runs them as they stand, and `bywire.bench.kpis.translator` writes their C.
"""

from __future__ import annotations

from bisect import bisect_right
from math import isfinite

from bywire.bench.kpis.kpi import Undefined

Samples = list[float]
"""a signal, or its times, sample after sample"""


def total(y: Samples) -> float:
    """Sum of the samples in the order of time: Python's own sum differs between its versions."""
    whole = 0.0
    for x in y:
        whole += x
    return whole


def integral(t: Samples, y: Samples) -> float:
    """Integral over time by the trapezoidal rule, exact for straight pieces."""
    whole = 0.0
    for k in range(1, len(t)):
        whole += 0.5 * (y[k] + y[k - 1]) * (t[k] - t[k - 1])
    return whole


def value_at(t: Samples, y: Samples, instant: float) -> float:
    """Signal at an instant, straight between samples, as at the ends beyond them."""
    k = bisect_right(t, instant) - 1
    if k < 0:
        return y[0]
    if k == len(t) - 1 or t[k] == instant:
        return y[k]
    return (y[k + 1] - y[k]) / (t[k + 1] - t[k]) * (instant - t[k]) + y[k]


def moving_average(t: Samples, y: Samples, period: float) -> Samples:
    """Centered moving average over a period, as `bywire.bench.kpis.smoothing.smoothed` has it."""
    last = len(t) - 1
    width = min(period, t[last] - t[0])
    slope = [(y[k + 1] - y[k]) / (t[k + 1] - t[k]) for k in range(len(t) - 1)]
    primitive = [0.0] * len(t)
    for k in range(1, len(t)):
        primitive[k] = primitive[k - 1] + 0.5 * (y[k] + y[k - 1]) * (t[k] - t[k - 1])
    mean = [0.0] * len(t)
    i = 0  # the intervals in which both ends of the period lie move on with it
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
    """Why no figure is defined over these times; None over sound ones."""
    if len(t) < 2:
        return Undefined(f"{len(t)} samples are too few: two at least are needed")
    wrong = 0  # counted to the end, in vectors: almost always there is none
    for k in range(1, len(t)):
        wrong += not t[k] > t[k - 1]
    if wrong > 0 or not isfinite(t[0]) or not isfinite(t[-1]):
        return Undefined("the times do not increase")
    return None


def defect_of_signal(t: Samples, y: Samples) -> Undefined | None:
    """Why no figure of a signal is defined; None of a sound one."""
    wrong = 0
    for x in y:
        wrong += not isfinite(x)
    if wrong > 0:
        k = 0
        while isfinite(y[k]):
            k += 1
        return Undefined(f"not a number at {t[k]:g} s")
    return None
