"""Filters of past samples: low-passes, lags, colored noise.

SciPy's own come with a package that takes longer to load than a short run takes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bywire.core.typing import Array


def filtered(
    numerator: Sequence[float] | Array,
    denominator: Sequence[float] | Array,
    x: Array,
    *,
    settled: bool = False,
) -> Array:
    r"""Return signals behind a filter.

    .. math:: y_k + a_1 y_{k-1} + \dots + a_p y_{k-p} = b_0 x_k + \dots + b_q x_{k-q}

    Parameters
    ----------
    numerator, denominator
        b and a, shapes (q + 1,) and (p + 1,); a begins with 1.
    x
        One row per sample, shape (n, ...).
    settled
        Whether the filter has long seen the first sample; at rest at zero otherwise.

    Returns
    -------
    numpy.ndarray
        Shape of ``x``.
    """
    from scipy.linalg import solve_banded

    b, a = (np.asarray(each, dtype=np.float64) for each in (numerator, denominator))
    x = np.asarray(x, dtype=np.float64)
    count = len(x)
    if not count:
        return x
    before = x[0] if settled else np.zeros_like(x[0])
    past = before * (b.sum() / a.sum()) if settled else before
    driven = np.zeros_like(x)
    for j, factor in enumerate(b):
        driven[j:] += factor * x[: max(count - j, 0)]
        driven[:j] += factor * before
    for j, factor in enumerate(a[1:], 1):
        driven[:j] -= factor * past
    diagonals = np.repeat(a[:count, None], count, axis=1)  # of a lower triangle
    return np.asarray(solve_banded((len(diagonals) - 1, 0), diagonals, driven))
