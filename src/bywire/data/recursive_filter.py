"""Recursive filters: low-pass filters, lags, colored noise.

SciPy's filters are in a package that takes longer to load than a short run takes to compute.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bywire.core.typing import Array

_BLOCK = 4096  # samples per solution, since a band matrix of many rows needs memory


def filtered(
    numerator: Sequence[float] | Array,
    denominator: Sequence[float] | Array,
    x: Array,
    *,
    settled: bool = False,
) -> Array:
    r"""Filter signals.

    .. math:: y_k + a_1 y_{k-1} + \dots + a_p y_{k-p} = b_0 x_k + \dots + b_q x_{k-q}

    Parameters
    ----------
    numerator, denominator
        b and a, shapes (q + 1,) and (p + 1,); a starts with 1.
    x
        One row per sample, shape (n, ...).
    settled
        Whether the filter starts in steady state at the first sample; otherwise at zero.

    Returns
    -------
    numpy.ndarray
        Shape of ``x``.
    """
    b, a = (np.asarray(each, dtype=np.float64) for each in (numerator, denominator))
    x = np.asarray(x, dtype=np.float64)
    count = len(x)
    if not count:
        return x
    before = x[0] if settled else np.zeros_like(x[0])
    driven = b[0] * x
    for j, factor in enumerate(b[1:], 1):
        driven[j:] += factor * x[: max(count - j, 0)]
        driven[:j] += factor * before
    return _recursive(a, driven, before * (b.sum() / a.sum()) if settled else before)


def low_passed(x: Array, f_c: float, interval: float) -> Array:
    """Filter samples by a first-order low-pass filter in steady state at the first one.

    Parameters
    ----------
    x
        Samples, shape (n,).
    f_c
        Cutoff frequency in Hz; if it is low, the result stays close to the first sample.
    interval
        Sample time in s.
    """
    decay = math.exp(-2.0 * math.pi * f_c * interval)
    # Relative to the first sample, since the static gain would be 0 / 0 if the decay rounds to 1.
    return np.asarray(x[0] + filtered([1.0 - decay], [1.0, -decay], x - x[0]))


def _recursive(a: Array, driven: Array, before: Array) -> Array:
    """Return y of sum a_j y_(k-j) = driven_k, in place; ``before``: y before the first sample."""
    from scipy.linalg.blas import dtbsv

    p = a.size - 1
    last = np.repeat(before[None], p, axis=0)
    for begin in range(0, len(driven) if p else 0, _BLOCK):
        part = driven[begin : begin + _BLOCK]
        for j in range(1, p + 1):
            part[:j] -= a[j] * last[p - j : p - j + len(part)]
        band = np.repeat(a[None, : len(part)], len(part), axis=0).T  # of a lower triangle
        for column in np.ndindex(part.shape[1:]):
            signal = (slice(None), *column)
            part[signal] = dtbsv(len(band) - 1, band, part[signal], lower=1, diag=1)
        last = np.concatenate([last, part])[-p:]
    return driven
