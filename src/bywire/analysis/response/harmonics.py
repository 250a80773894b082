"""Harmonic content of periodic signals."""

from __future__ import annotations

import math

import numpy as np

from bywire.core.typing import Array, Complex


def amplitudes(t: Array, y: Array, f: float, count: int) -> Complex:
    """Return the complex amplitudes of the first harmonics, sine phase.

    Parameters
    ----------
    t, y
        Evenly spaced times [s] and samples over whole periods, shape (n,) each.
    f
        Base frequency [Hz].
    count
        Number of harmonics.
    """
    order = np.arange(1, count + 1)[:, None]
    return np.asarray(2j * np.mean(y * np.exp(-2j * math.pi * f * order * t), axis=1))


def total_distortion(t: Array, y: Array, f: float, count: int = 9) -> float:
    r"""Return the total harmonic distortion, a share.

    .. math:: \mathrm{THD} = \sqrt{\sum_{k=2}^{n} |a_k|^2} \, / \, |a_1|

    Parameters
    ----------
    t, y, f
        As in `amplitudes`.
    count
        Highest harmonic n; below half the sampling rate.
    """
    size = np.abs(amplitudes(t, y, f, count))
    return float(np.sqrt(np.sum(size[1:] ** 2)) / size[0])
