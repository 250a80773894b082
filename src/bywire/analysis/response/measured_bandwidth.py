"""Where a measured frequency response has fallen."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

DROP = math.sqrt(0.5)
"""share of the start to which a response has fallen at its bandwidth: -3 dB"""


def fall(gain: Array, frequencies: Array, start: float = 1.0, drop: float = DROP) -> float:
    """Return the lowest frequency at which a gain has fallen, straight on logarithmic axes.

    Parameters
    ----------
    gain
        Magnitudes, shape (n,); NaN, where the output sticks, counts as 0.
    frequencies
        Ascending [Hz], shape (n,).
    start
        Magnitude that counts as 1, in the gain's unit: that at standstill.
    drop
        Share of the start that counts as fallen.

    Returns
    -------
    float
        In Hz; 0 where the gain is below from the lowest frequency on, infinity where it stays
        above.
    """
    size, level = np.nan_to_num(gain), drop * start
    below = np.flatnonzero(size < level)
    if below.size == 0:
        return math.inf
    k = int(below[0])
    if k == 0:
        return 0.0
    if size[k] == 0.0:  # it breaks off there: the last frequency at which it moved
        return float(frequencies[k - 1])
    share = math.log(size[k - 1] / level) / math.log(size[k - 1] / size[k])
    return float(frequencies[k - 1] * (frequencies[k] / frequencies[k - 1]) ** share)


def complex_values(one: xr.Dataset) -> Complex:
    """Return gain and phase of a response as complex numbers, NaN where the output sticks."""
    return np.asarray(one["gain"].values * np.exp(1j * np.radians(one["phase"].values)))
