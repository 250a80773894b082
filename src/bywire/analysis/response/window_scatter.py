"""How far a periodic response scatters from window to window."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.simulation.repetition import KEPT

Complex = NDArray[np.complex128]


def kept(figures: Complex, settled: NDArray[np.bool_]) -> np.ma.MaskedArray[Any, Any]:
    """Return the windows that count: the last two of what repeats, else all that are kept.

    Parameters
    ----------
    figures
        Complex amplitudes of the last windows, shape (cases, KEPT, lines); see
        ``simulation.repetition``.
    settled
        Which cases repeat, shape (cases,).
    """
    old = np.arange(KEPT)[None] < np.where(settled, KEPT - 2, 0)[:, None]
    return np.ma.array(figures, mask=np.isnan(figures) | old[:, :, None])


def spread_of(
    figures: Complex, settled: NDArray[np.bool_]
) -> tuple[Complex, NDArray[np.float64]]:
    """Return complex amplitudes and their scatter.

    Parameters
    ----------
    figures, settled
        As in `kept`.

    Returns
    -------
    tuple
        Amplitudes, shape (cases, lines): those of the last window where they repeat, else the
        mean of the windows that count. Their scatter as a share of that: root mean square of the
        windows' distance from their mean. A drift counts as scatter.
    """
    seen = kept(figures, settled)
    mean = seen.mean(axis=1)
    apart = np.sqrt((np.abs(seen - mean[:, None]) ** 2).mean(axis=1))
    value = np.where(settled[:, None], figures[:, -1], np.ma.filled(mean, np.nan))
    with np.errstate(invalid="ignore", divide="ignore"):
        return value, np.asarray(np.ma.filled(apart, np.nan) / np.abs(value))
