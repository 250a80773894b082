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
    """What a run recorded, or several side by side.

    Those of several runs answer families of key figures and books alone: take a `case` for others.

    Parameters
    ----------
    time
        Times [s], shape (time,).
    signals
        Values by name, shape (time,) each; of several runs (runs, time).
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
        self._values = {**signals, TIME: time}
        self._attributes = {**attributes, TIME: {"units": "s", "long_name": "time"}}
        self._signals = tuple(signals)
        self.silent: frozenset[str] = frozenset()  # parts of the model that have nothing to say
        self.sizes = {TIME: time.size}

    def case(self, k: int, notes: Callable[[], Mapping[str, Any]] = dict) -> Rows:
        """Return the rows of one run of several."""
        signals = {name: self._values[name][k] for name in self._signals}
        rows = Rows(self._values[TIME], signals, self._attributes, notes)
        rows.silent = self.silent
        return rows

    def with_signals(
        self, signals: Mapping[str, Array], attributes: Mapping[str, Mapping[str, Any]]
    ) -> Rows:
        """Return the rows with further signals; see `Rows` for both."""
        every = {name: self._values[name] for name in self._signals}
        return Rows(
            self._values[TIME], {**every, **signals}, {**self._attributes, **attributes}
        )

    @property
    def data_vars(self) -> Mapping[str, Row]:
        """The signals by name."""
        return _Named(self, self._signals)

    @property
    def variables(self) -> Mapping[str, Row]:
        """The signals and their time, by name."""
        return _Named(self, tuple(self._values))

    def __iter__(self) -> Iterator[str]:
        return iter(self._signals)

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __getitem__(self, name: Any) -> Any:
        if not isinstance(name, str):
            return self.dataset[name]
        # None is kept: arrays of rows that held it in turn would wait for a search for garbage.
        return Row(self, name, self._values[name], self._attributes[name])

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
        each = {
            name: (TIME, values, dict(self._attributes[name]))
            for name, values in self._values.items()
        }
        time = each.pop(TIME)
        return xr.Dataset(each, coords={TIME: time}, attrs=self.attrs)


class _Named(Mapping[str, Row]):
    """Signals of rows by name."""

    def __init__(self, rows: Rows, names: tuple[str, ...]) -> None:
        self._rows, self._names = rows, names

    def __getitem__(self, name: str) -> Row:
        row: Row = self._rows[name]
        return row

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)
