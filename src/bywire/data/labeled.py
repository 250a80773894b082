"""Datasets whose variables have units and labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array

if TYPE_CHECKING:
    import xarray as xr

Labeled = tuple[Any, str, str]
"""values, unit and label"""


def labeled(axes: Mapping[str, Labeled], variables: Mapping[str, Labeled]) -> xr.Dataset:
    """Return variables over axes.

    Parameters
    ----------
    axes
        Coordinates by name; every variable has all of them as its dimensions, in this order.
    variables
        Variables by name.

    Examples
    --------
    >>> data = labeled({"time": ([0.0, 1.0], "s", "time")}, {"i": ([2.0, 3.0], "A", "current")})
    >>> data["i"].attrs
    {'units': 'A', 'long_name': 'current'}
    """
    import xarray as xr  # slow to load

    dims = tuple(axes)
    return xr.Dataset(
        {
            name: (dims, values, _attrs(unit, label))
            for name, (values, unit, label) in variables.items()
        },
        {name: (name, values, _attrs(unit, label)) for name, (values, unit, label) in axes.items()},
    )


def over(
    x: tuple[str, Any, str, str],
    columns: Mapping[str, Any],
    unit: str,
    label: str,
    branches: tuple[str, Sequence[str]] | None = None,
    along: str = "window",
) -> xr.Dataset:
    """Return columns of one quantity versus another one.

    Parameters
    ----------
    x
        Name, values, unit and label of the horizontal axis.
    columns
        The columns by name, all in the same unit.
    unit, label
        Unit and label of the quantity.
    branches
        Dimension and labels of several curves; the columns then have a row for each.
    along
        Dimension of the points if every curve has its own abscissae; ``x`` then also has a row for
        each curve.
    """
    name, places, *attributes = x
    if branches is None:
        return labeled(
            {name: (places, *attributes)}, {n: (c, unit, label) for n, c in columns.items()}
        )
    import xarray as xr  # slow to load

    kind, labels = branches
    own = np.ndim(places) > 1
    dims = (kind, along if own else name)
    return xr.Dataset(
        {n: (dims, c, _attrs(unit, label)) for n, c in columns.items()},
        {kind: list(labels), name: (dims if own else name, places, _attrs(*attributes))},
    )


def at_own_places(places: Sequence[Array], rows: Sequence[Array]) -> tuple[Array, Array]:
    """Return curves at their own abscissae, in ascending order.

    Nothing is interpolated, so all points are measured points.

    ``places``: abscissae of each curve, shape (n_k,), in any order; ``rows``: values there, shape
    (..., n_k).

    Returns
    -------
    tuple
        Abscissae, shape (curves, n), and curves, shape (..., curves, n), where n is the maximum
        number of points; shorter curves are filled with NaN.
    """
    count = max(place.size for place in places)

    def filled(values: Array, order: NDArray[np.intp]) -> Array:
        beyond = np.full((*values.shape[:-1], count - order.size), np.nan)
        return np.concatenate((values[..., order], beyond), axis=-1)

    orders = [np.argsort(place, kind="stable") for place in places]
    x = [filled(place, order) for place, order in zip(places, orders, strict=True)]
    table = [filled(row, order) for row, order in zip(rows, orders, strict=True)]
    return np.stack(x), np.stack(table, axis=-2)


def _attrs(unit: str, label: str) -> dict[str, str]:
    return {"units": unit, "long_name": label}
