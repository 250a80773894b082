"""Moving average over one dither period: the explicit choice where ripple is not the subject."""

from __future__ import annotations

import numpy as np

from bywire.core.typing import Array


def smoothed(t: Array, y: Array, period: float) -> Array:
    r"""Return the centered moving average over a period.

    .. math:: \bar y(t) = \frac{1}{T} \int_{c - T/2}^{c + T/2} y \, d\tau, \quad
              c = \min(\max(t, t_0 + T/2), t_1 - T/2)

    The signal counts as straight between samples and is integrated exactly. A ripple of this
    period vanishes everywhere. There is no delay, but an edge is smeared over half a period to
    both sides: a dead time is shortened, a rise time lengthened by up to that. Within half a
    period of either end the nearest full average holds, so a step should not lie there.

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
        """Return the integral of the piecewise straight signal from ``t[0]`` to each instant."""
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
    return f"of the moving average over {period:g} s" if period > 0 else ""
