"""Several curves, each read at places of its own, on one axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def on_common_axis(
    places: Sequence[Array], rows: Sequence[Array], count: int = 200
) -> tuple[Array, Array]:
    """Return curves interpolated to one axis; nothing (NaN) beyond a curve's own ends.

    Parameters
    ----------
    places
        Where each curve was read, shape (n_k,), in any order.
    rows
        What was read there, shape (..., n_k).
    count
        Points of the axis.

    Returns
    -------
    tuple
        The axis, shape (count,), and the curves, shape (..., curves, count).
    """
    low, high = min(p.min() for p in places), max(p.max() for p in places)
    x = np.linspace(low, high, count)
    found = []
    for place, row in zip(places, rows, strict=True):
        order = np.argsort(place)
        flat = row.reshape(-1, place.size)[:, order]
        own = [np.interp(x, place[order], one, left=np.nan, right=np.nan) for one in flat]
        found.append(np.reshape(own, (*row.shape[:-1], count)))
    return x, np.stack(found, axis=-2)
