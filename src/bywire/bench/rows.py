"""The rows of a run as plain arrays, in place of a recording: for many runs that nobody looks at.

To make a Dataset of thirty signals takes longer than to simulate them. Key figures, warnings and
books of energy ask a recording for little; whatever else a brake's own code asks for, the Dataset
is made and answers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.lib.mixins import NDArrayOperatorsMixin

from bywire.core.typing import Array

TIME = "time"


class Row(NDArrayOperatorsMixin):
    """A signal of `Rows`, or their time.

    Parameters
    ----------
    rows
        What it belongs to.
    name
        Its name there.
    values
        Shape (time,).
    attrs
        Unit, label and role, as a recording has them.
    """

    dims = (TIME,)
    ndim = 1

    def __init__(self, rows: Rows, name: str, values: Array, attrs: Mapping[str, Any]) -> None:
        self._rows, self._name = rows, name
        self.values, self.attrs = values, attrs

    @property
    def size(self) -> int:
        """How many rows there are."""
        return self.values.size

    def __len__(self) -> int:
        return len(self.values)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.values, dtype=dtype, copy=copy)

    def __array_ufunc__(self, function: np.ufunc, method: str, *inputs: Any, **given: Any) -> Any:
        arrays = [each._array if isinstance(each, Row) else each for each in inputs]
        return getattr(function, method)(*arrays, **given)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._array, name)

    def __getitem__(self, key: Any) -> Any:
        return self._array[key]

    @property
    def _array(self) -> xr.DataArray:
        return self._rows.dataset[self._name]


class Rows:
    """What a run recorded.

    Parameters
    ----------
    time
        Times [s], shape (time,).
    signals
        Values by name, shape (time,) each.
    attributes
        Unit, label and role of each signal, as a recording has them.
    notes
        ``notes()``: the attributes of the whole recording, of which few are ever asked for.
    """

    def __init__(
        self,
        time: Array,
        signals: Mapping[str, Array],
        attributes: Mapping[str, Mapping[str, Any]],
        notes: Callable[[], Mapping[str, Any]] = dict,
    ) -> None:
        self._notes = notes
        self.data_vars = {
            name: Row(self, name, values, attributes[name]) for name, values in signals.items()
        }
        clock = {"units": "s", "long_name": "time"}
        self.variables = {**self.data_vars, TIME: Row(self, TIME, time, clock)}
        self.sizes = {TIME: time.size}

    def __iter__(self) -> Iterator[str]:
        return iter(self.data_vars)

    def __contains__(self, name: object) -> bool:
        return name in self.variables

    def __getitem__(self, name: Any) -> Any:
        return self.variables[name] if isinstance(name, str) else self.dataset[name]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.dataset, name)

    @cached_property
    def attrs(self) -> dict[str, Any]:
        """Attributes of the whole recording."""
        return dict(self._notes())

    @cached_property
    def dataset(self) -> xr.Dataset:
        """The same as a Dataset."""
        time = self.variables[TIME]
        return xr.Dataset(
            {name: (TIME, row.values, dict(row.attrs)) for name, row in self.data_vars.items()},
            coords={TIME: (TIME, time.values, dict(time.attrs))},
            attrs=self.attrs,
        )
