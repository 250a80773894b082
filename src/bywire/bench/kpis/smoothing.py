"""Moving average over one dither period: the explicit choice where ripple is not the subject."""

from __future__ import annotations

import numpy as np

from bywire.bench.kpis.kpi import Array


def smoothed(t: Array, y: Array, period: float) -> Array:
    r"""Return the centered moving average over a period.

    .. math:: \bar y(t) = \frac{1}{b - a} \int_a^b y \, d\tau, \quad
              a = \max(t - T/2, t_0), \; b = \min(t + T/2, t_1)

    The signal counts as straight between samples and is integrated exactly. A ripple of this
    period vanishes. There is no delay, but an edge is smeared over half a period to both sides,
    so that a dead time is shortened and a rise time lengthened by up to that. At both ends the
    average runs over what there is, so up to half a period of ripple can remain there.

    Parameters
    ----------
    t
        Times [s], increasing, shape ``(n,)``.
    y
        Signal, shape ``(n,)``.
    period
        Averaging time T [s]; zero or less returns the signal itself.

    Returns
    -------
    numpy.ndarray
        Shape ``(n,)``.
    """
    if period <= 0 or t.size < 2:
        return y
    a = np.maximum(t - 0.5 * period, t[0])
    b = np.minimum(t + 0.5 * period, t[-1])
    return np.asarray((_primitive(t, y, b) - _primitive(t, y, a)) / (b - a))


def treatment(period: float) -> str:
    """Return the note on figures of a smoothed signal; empty for the raw one."""
    return f"of the moving average over {period:g} s" if period > 0 else ""


def _primitive(t: Array, y: Array, at: Array) -> Array:
    """Return the integral of the piecewise straight signal from ``t[0]`` to each instant."""
    pieces = 0.5 * (y[1:] + y[:-1]) * np.diff(t)
    total = np.concatenate(([0.0], np.cumsum(pieces)))
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, t.size - 2)
    d = at - t[k]
    slope = (y[k + 1] - y[k]) / (t[k + 1] - t[k])
    return np.asarray(total[k] + y[k] * d + 0.5 * slope * d**2)
