"""Several curves, each read at places of its own, in one table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array


def at_own_places(places: Sequence[Array], rows: Sequence[Array]) -> tuple[Array, Array]:
    """Return curves at the places where each was read, in ascending order.

    Nothing is interpolated: what is shown as measured was measured there.

    ``places``: where each curve was read, shape (n_k,), in any order; ``rows``: what was read
    there, shape (..., n_k).

    Returns
    -------
    tuple
        Places, shape (curves, n), and curves, shape (..., curves, n), with n the most places that
        a curve has; NaN beyond those of a shorter one.
    """
    count = max(place.size for place in places)

    def filled(values: Array, order: NDArray[np.intp]) -> Array:
        beyond = np.full((*values.shape[:-1], count - order.size), np.nan)
        return np.concatenate((values[..., order], beyond), axis=-1)

    orders = [np.argsort(place, kind="stable") for place in places]
    x = [filled(place, order) for place, order in zip(places, orders, strict=True)]
    table = [filled(row, order) for row, order in zip(rows, orders, strict=True)]
    return np.stack(x), np.stack(table, axis=-2)
