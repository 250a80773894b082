"""Recordings of runs: as datasets with units and origin, and as plain rows for many runs."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Collection, ItemsView, Iterator, Mapping, Sequence, ValuesView
from functools import cache, cached_property
from numbers import Number
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from bywire.bench.energy_ledger import energy_doubts, energy_signals, role_attributes
from bywire.core.on_demand import OnDemand
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Signal, signals_of
from bywire.core.typing import Array
from bywire.core.version import __version__
from bywire.simulation.advance import put_in_signals
from bywire.simulation.ensemble import RunGroup
from bywire.simulation.run import Run, Trajectory
from bywire.simulation.run_table import doubts_of, one_of, parameters_of

if TYPE_CHECKING:
    import xarray as xr

    from bywire.simulation.cuda import HeldRows


def parameter_hash(par: ParameterSet) -> str:
    """Return a short digest of all values and choices."""
    text = json.dumps(par.flat(), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def record(
    run: Run, trajectory: Trajectory, settle: float, keep: float, notes: Mapping[str, Any]
) -> xr.Dataset:
    """Return the recording of a run.

    ``settle``: time of the run [s] before the recording's zero; ``keep``: part of the settling time
    that the recording includes, at negative times; ``notes``: additional attributes, such as the
    experiment's name.

    Returns
    -------
    xarray.Dataset
        Dimension ``time`` [s]; variables with ``units`` and ``long_name``.
    """
    return watched_rows(run, trajectory, settle, keep, notes).dataset


def watched_rows(
    run: Run, trajectory: Trajectory, settle: float, keep: float, notes: Mapping[str, Any]
) -> Rows:
    """Return the content of a run's recording as plain arrays, with its warnings; see `record`."""
    rows = rows_of(run, trajectory, settle, keep)
    warnings = watch(cast("xr.Dataset", rows), run, trajectory)
    return rows.noted({**run_notes(run, trajectory), "warnings": warnings, **notes})


def run_notes(run: Run, trajectory: Trajectory) -> dict[str, Any]:
    """Return the attributes of a recording that describe its run, without warnings."""
    return {
        "bywire_version": __version__,
        "model": run.model.name,
        "parameter_hash": parameter_hash(run.par),
        "parameters": run.par.model_dump_json(),
        "step": run.step,
        "engine": trajectory.engine,
        "status": trajectory.status,
        "unsettled_substeps": trajectory.unsettled,
        "repeated_substeps": trajectory.repeated,
    }


def rows_of(
    run: Run,
    trajectory: Trajectory,
    settle: float,
    keep: float,
    notes: Callable[[], Mapping[str, Any]] = dict,
) -> Rows:
    """Return the content of a run's recording as plain arrays, without warnings; see `record`."""
    time = trajectory.time - settle
    begin = int(np.searchsorted(time, -keep - 1e-9))
    attributes = _attributes_of(run.model.Output)
    # A copy makes each signal contiguous, and frees the memory of the settling.
    kept = dict(zip(trajectory.names, trajectory.values[begin:].T.copy(), strict=True))
    signals = {name: kept[name] for name in attributes if name in kept}
    return Rows(
        np.round(time[begin:], 12),
        signals,
        attributes,
        lambda: {**run_notes(run, trajectory), **notes()},
        run.par,
    )


def rows_of_group(group: RunGroup, settle: float) -> Rows:
    """Return the content of the recordings of several runs, for the computed rows."""
    signals = group.signals
    attributes = _attributes_of(one_of(group.runs).model.Output)
    rows = Rows(
        np.round(group.time - settle, 12), signals, {name: attributes[name] for name in signals}
    )
    rows.held = None if group.held is None else Held(group.held, group.names)
    return rows


def ends_of_group(group: RunGroup) -> Rows:
    """Return the first and last rows of several runs, with all signals that are recorded there."""
    values = {**group.edges, **dict(zip(group.end_names, group.ends, strict=True))}
    attributes = _attributes_of(one_of(group.runs).model.Output)
    signals = {name: values[name] for name in attributes if name in values}
    return Rows(group.time[[0, -1]], signals, {name: attributes[name] for name in signals})


@cache
def _attributes_of(output: type) -> Mapping[str, Mapping[str, str]]:
    every = {**signals_of(output), **put_in_signals(output)}
    return {name: _attributes(signal) for name, signal in every.items()}


def _attributes(signal: Signal) -> dict[str, str]:
    attributes = {"units": signal.unit, "long_name": signal.label}
    attributes |= {"set_point_of": signal.set_point_of} if signal.set_point_of else {}
    return attributes | role_attributes(signal.role)


def watch(recording: xr.Dataset, run: Run, trajectory: Trajectory) -> list[str]:
    """Return warnings on a recording: ranges of validity, end stops, solver problems, energies."""
    if not recording.sizes["time"]:  # interrupted before the first row
        return []
    doubts = solver_doubts(trajectory.doubt, trajectory.unsettled)
    return [*doubts, *energy_doubts(recording, [run]), *run.model.watch(recording, run.par)]


def watch_cases(
    rows: Rows, runs: Sequence[Run], unsettled: Sequence[int], books: Sequence[Sequence[str]]
) -> list[list[str]]:
    """Return the warnings of `watch` for each of several runs of one structure and plan.

    ``rows``: rows of all runs; ``unsettled``: number of substeps of each run that hit the contact
    iteration's limit; ``books``: `energy_doubts` of each run.
    """
    solver = map(solver_doubts, doubts_of(runs), unsettled)
    model, pars = one_of(runs).model, parameters_of(runs)
    rows.silent = model.silent(rows, pars)
    asked = set(model.may_warn(rows, pars))
    return [
        [*doubts, *book, *(model.watch(rows.case(k), pars[k]) if k in asked else ())]
        for k, (doubts, book) in enumerate(zip(solver, books, strict=True))
    ]


def solver_doubts(doubt: str, unsettled: int) -> list[str]:
    """Return a solver's warnings; ``unsettled``: substeps at the contact iteration's limit."""
    doubts = [doubt] if doubt else []
    if unsettled:
        doubts.append(f"{unsettled} substeps hit the contact iteration's limit. Use a smaller step")
    return doubts


def energy_doubts_of(run: Run, trajectory: Trajectory) -> list[str]:
    """Return the `energy_doubts` of a run with computed `energy_signals`."""
    if not trajectory.time.size:
        return []
    attributes = _attributes_of(run.model.Output)
    energies = {name: trajectory[name] for name in energy_signals(run)}
    rows = Rows(trajectory.time, energies, {name: attributes[name] for name in energies})
    return energy_doubts(cast("xr.Dataset", rows), [run])


# --- Rows in place of a recording, for many runs without plots
# Building a Dataset of thirty signals takes longer than the simulation. Key figures, warnings and
# energy balances need only signals, time windows, sums and products of signals, and their extremes
# and means. Any other operation in a brake's code builds the Dataset, or a signal's DataArray, on
# demand.

TIME = "time"


class Row(NDArrayOperatorsMixin):
    """Signal of `Rows`, or the time.

    Parameters
    ----------
    rows
        Rows to which it belongs.
    name
        Name in these rows.
    values
        Values, shape (time,).
    attrs
        Unit, label and role, as in a recording.
    """

    dims = (TIME,)
    ndim = 1

    def __init__(self, rows: Rows, name: str, values: Array, attrs: Mapping[str, Any]) -> None:
        self._rows, self._name = rows, name
        self.values, self.attrs = values, attrs

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.values.size

    def __len__(self) -> int:
        return len(self.values)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.values, dtype=dtype, copy=copy)

    def __array_ufunc__(self, function: np.ufunc, method: str, *inputs: Any, **given: Any) -> Any:
        is_plain = method == "__call__" and not given and function.nout == 1
        if is_plain and all(map(self._fits, inputs)):
            plain = (each.values if isinstance(each, Row) else each for each in inputs)
            return Row(self._rows, "", function(*plain), {})
        arrays = [each._array if isinstance(each, Row) else each for each in inputs]
        return getattr(function, method)(*arrays, **given)

    def _fits(self, other: Any) -> bool:
        if isinstance(other, Row):
            return other._time is self._time and other.values.shape == self.values.shape
        return isinstance(other, Number)

    def max(self, *asked: Any, **given: Any) -> Any:
        """Return the maximum, like a DataArray."""
        return self._reduced("max", *asked, **given)

    def min(self, *asked: Any, **given: Any) -> Any:
        """Return the minimum, like a DataArray."""
        return self._reduced("min", *asked, **given)

    def mean(self, *asked: Any, **given: Any) -> Any:
        """Return the mean, like a DataArray."""
        return self._reduced("mean", *asked, **given)

    def _reduced(self, how: str, *asked: Any, **given: Any) -> Any:
        is_plain = not asked and not given and self.values.ndim == 1 and self.values.size
        value = getattr(self.values, how)() if is_plain else math.nan
        return getattr(self._array, how)(*asked, **given) if np.isnan(value) else value

    def sel(self, *asked: Any, **given: Any) -> Any:
        """Return the rows in a time window, ``time=slice(begin, end)``, like a DataArray."""
        window = _window(self._time, asked, given)
        if window is None:
            return self._array.sel(*asked, **given)
        rows = Rows(self._time[window], {}, {})
        return Row(rows, self._name, self.values[window], self.attrs)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._array, name)

    def __getitem__(self, key: Any) -> Any:
        return self._array[key]

    @property
    def _time(self) -> Array:
        return self._rows._values[TIME]

    @property
    def _array(self) -> xr.DataArray:
        import xarray as xr  # slow to load

        axis = (TIME, self._time, dict(self._rows._attributes[TIME]))
        return xr.DataArray(
            self.values, {TIME: axis}, (TIME,), self._name or None, dict(self.attrs)
        )


def _window(time: Array, asked: tuple[Any, ...], given: Mapping[str, Any]) -> slice | None:
    """Return the slice of rows for a time window as in `sel`; None for other arguments."""
    wanted = given.get(TIME)
    if asked or len(given) != 1 or not isinstance(wanted, slice) or wanted.step is not None:
        return None
    begin = 0 if wanted.start is None else int(np.searchsorted(time, wanted.start, "left"))
    end = time.size if wanted.stop is None else int(np.searchsorted(time, wanted.stop, "right"))
    return slice(begin, max(begin, end))


class Held(NamedTuple):
    """Rows of several runs that a graphics processor holds, and the names of their signals."""

    rows: HeldRows
    names: tuple[str, ...]

    def address(self, name: str) -> int:
        """Return the address of a signal's rows in the first run; other runs follow."""
        return self.rows.address(self.names.index(name))

    def extremes(self, name: str) -> Array:
        """Return the first, lowest, highest and last row of a signal, shape (runs, 4)."""
        extremes: Array = self.rows.extremes[self.names.index(name)]
        return extremes


class Rows:
    """Recorded rows of a run, or of several runs side by side.

    Only families of key figures and energy balances accept rows of several runs. Use `case` for all
    other purposes.

    Parameters
    ----------
    time
        Times [s], shape (time,).
    signals
        Values by name, shape (time,) each; for several runs (runs, time).
    attributes
        Unit, label and role of each signal, as in a recording.
    notes
        ``notes()``: attributes of the whole recording, computed on demand.
    par
        Parameters of the run, if known.
    """

    stands_for = "Dataset"
    """type whose interface it has, for checks of arguments"""

    def __init__(
        self,
        time: Array,
        signals: Mapping[str, Array],
        attributes: Mapping[str, Mapping[str, Any]],
        notes: Callable[[], Mapping[str, Any]] = dict,
        par: ParameterSet | None = None,
    ) -> None:
        self._notes, self.par = notes, par
        self._values: Mapping[str, Array] = (
            {**signals, TIME: time}  # the time keeps its place among the signals
            if isinstance(signals, dict)
            else OnDemand((*signals, TIME), lambda name: time if name == TIME else signals[name])
        )
        self._attributes = {**attributes, TIME: {"units": "s", "long_name": "time"}}
        self._signals = tuple(name for name in signals if name != TIME)
        self.silent: frozenset[str] = frozenset()  # parts of the model without warnings
        self.held: Held | None = None  # by a graphics processor
        self.sizes = {TIME: time.size}

    @classmethod
    def of(cls, recording: xr.Dataset) -> xr.Dataset:
        """Return rows in place of a recording, which are faster, or the recording itself.

        A static characteristic, for example, has no rows over time.
        """
        if (
            isinstance(recording, cls)
            or set(recording.dims) != {TIME}
            or set(recording.coords) != {TIME}
        ):
            return recording
        each = {str(name): one for name, one in recording.variables.items() if name != TIME}
        rows = cls(
            recording.variables[TIME].values,
            {name: one.values for name, one in each.items()},
            {name: one.attrs for name, one in each.items()},
            lambda: recording.attrs,
        )
        rows.__dict__["dataset"] = recording  # available already
        return cast("xr.Dataset", rows)  # it has the same interface

    def outline(self, name: str) -> Array | None:
        """Return first, lowest, highest and last values of a signal in each run, shape (runs, 4).

        None for rows that a graphics processor does not hold, or that are not finite.
        """
        values = None if self.held is None else self.held.extremes(name)
        return None if values is None or not np.isfinite(values).all() else values

    def outlined(self) -> Rows:
        """Return rows with the first, lowest, highest and last value of each signal."""
        time = self._values[TIME][[0, 0, -1, -1]]
        found = self._extremes if self.held is None else self.held.extremes
        return Rows(time, OnDemand(self._signals, found), self._attributes)

    def _extremes(self, name: str) -> Array:
        y = self._values[name]
        each = (y[..., 0], y.min(axis=-1), y.max(axis=-1), y[..., -1])
        return np.stack(each, axis=-1)

    def unit(self, name: str) -> str:
        """Return the SI unit of a signal; ``"1"`` if none is recorded."""
        return str(self._attributes[name].get("units", "1"))

    def case(
        self,
        k: int,
        notes: Callable[[], Mapping[str, Any]] = dict,
        par: ParameterSet | None = None,
    ) -> Rows:
        """Return the rows of one run of several."""
        values = self._values
        signals: Mapping[str, Array] = (
            {name: values[name][k] for name in self._signals}
            if isinstance(values, dict)
            else OnDemand(self._signals, lambda name: values[name][k])
        )
        rows = Rows(values[TIME], signals, self._attributes, notes, par)
        rows.silent = self.silent
        return rows

    def sel(self, *asked: Any, **given: Any) -> Any:
        """Return the rows in a time window, ``time=slice(begin, end)``, like a Dataset."""
        window = _window(self._values[TIME], asked, given)
        return self.dataset.sel(*asked, **given) if window is None else self._within(window)

    def isel(self, *asked: Any, **given: Any) -> Any:
        """Return the rows of an index range, ``time=slice(begin, end)``, like a Dataset."""
        window = given.get(TIME)
        if asked or len(given) != 1 or not isinstance(window, slice):
            return self.dataset.isel(*asked, **given)
        return self._within(window)

    def _within(self, window: slice) -> Rows:
        signals = {name: self._values[name][window] for name in self._signals}
        return self._like(signals, self._attributes, self._values[TIME][window])

    def _like(
        self,
        signals: Mapping[str, Array],
        attributes: Mapping[str, Mapping[str, Any]],
        time: Array | None = None,
    ) -> Rows:
        """Return other signals of the same run."""
        here = self._values[TIME] if time is None else time
        rows = Rows(here, signals, attributes, lambda: self.attrs, self.par)
        rows.silent = self.silent
        return rows

    def assign(self, signals: Mapping[str, Any] | None = None, **named: Any) -> Any:
        """Return the rows with added or replaced signals, like a Dataset."""
        given = {**(signals or {}), **named}
        plain = {name: _plain(each, self._values[TIME]) for name, each in given.items()}
        if any(each is None for each in plain.values()):
            return self.dataset.assign(given)
        known = {name: each for name, each in plain.items() if each is not None}
        return self._like(
            {**self._values, **{name: values for name, (values, _) in known.items()}},
            {**self._attributes, **{name: attrs for name, (_, attrs) in known.items()}},
        )

    def noted(self, notes: Mapping[str, Any]) -> Rows:
        """Return the rows with their own attributes: of the whole recording, and of each signal."""
        signals = {name: self._values[name] for name in self._signals}
        attributes = {name: dict(self._attributes[name]) for name in self._signals}
        return Rows(self._values[TIME], signals, attributes, lambda: notes, self.par)

    def with_signals(
        self, signals: Mapping[str, Array], attributes: Mapping[str, Mapping[str, Any]]
    ) -> Rows:
        """Return the rows with additional signals; parameters as in `Rows`."""
        every = {name: self._values[name] for name in self._signals}
        return Rows(self._values[TIME], {**every, **signals}, {**self._attributes, **attributes})

    def drop_vars(self, names: str | Collection[str]) -> Rows:
        """Return the rows without some signals."""
        left_out = {names} if isinstance(names, str) else set(names)
        kept = {name: self._values[name] for name in self._signals if name not in left_out}
        return self._like(kept, self._attributes)

    @property
    def data_vars(self) -> Mapping[str, Row]:
        """The signals by name."""
        return _Named(self, self._signals)

    @property
    def variables(self) -> Mapping[str, Row]:
        """The signals and their time, by name."""
        return _Named(self, tuple(self._values))

    def items(self) -> ItemsView[str, Row]:
        """Return the signals with their names, like a Dataset."""
        return self.data_vars.items()

    def values(self) -> ValuesView[Row]:
        """Return the signals, like a Dataset."""
        return self.data_vars.values()

    @property
    def dims(self) -> tuple[str]:
        """Name of the only dimension."""
        return (TIME,)

    @property
    def nbytes(self) -> int:
        """Size of all values in memory [bytes]."""
        return sum(each.nbytes for each in self._values.values())

    def __iter__(self) -> Iterator[str]:
        return iter(self._signals)

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __getitem__(self, name: Any) -> Any:
        if not isinstance(name, str):
            return self.dataset[name]
        # No cache: a cycle of rows and their signals would delay freeing their memory.
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
        """Rows as a Dataset."""
        import pandas as pd  # slow to load, like xarray
        import xarray as xr

        variables = {
            name: (TIME, self._values[name], dict(self._attributes[name])) for name in self._signals
        }
        # A pandas index: for an array, xarray would import pint to check its type.
        axis = pd.Index(self._values[TIME], name=TIME)
        coords = {TIME: (TIME, axis, dict(self._attributes[TIME]))}
        return xr.Dataset(variables, coords=coords, attrs=self.attrs)


class Recordings(Mapping[str, "xr.Dataset"]):
    """Recordings by label, which become datasets when they are read.

    Parameters
    ----------
    recordings
        Rows, or datasets.
    """

    def __init__(self, recordings: Mapping[str, Any]) -> None:
        self._recordings = dict(recordings)

    @property
    def rows(self) -> Mapping[str, xr.Dataset]:
        """The recordings as rows, except those that are already datasets."""
        return {
            label: each.__dict__.get("dataset", each) if isinstance(each, Rows) else each
            for label, each in self._recordings.items()
        }

    def __getitem__(self, label: str) -> xr.Dataset:
        each = self._recordings[label]
        return each.dataset if isinstance(each, Rows) else cast("xr.Dataset", each)

    def __iter__(self) -> Iterator[str]:
        return iter(self._recordings)

    def __len__(self) -> int:
        return len(self._recordings)

    def __repr__(self) -> str:
        return repr(dict(self))

    def __reduce__(self) -> tuple[Any, ...]:
        return Recordings, (dict(self),)


def _plain(given: Any, time: Array) -> tuple[Array, Mapping[str, Any]] | None:
    """Return values and attributes of a signal for `Rows.assign`; None for other arguments."""
    if isinstance(given, Row):
        return (given.values, dict(given.attrs)) if given._time is time else None
    if isinstance(given, tuple) and given[0] == TIME and np.shape(given[1]) == time.shape:
        return np.asarray(given[1]), given[2] if len(given) > 2 else {}
    return None


class _Named(Mapping[str, Row]):
    """Signals of rows by name."""

    def __init__(self, rows: Rows, names: tuple[str, ...]) -> None:
        self._rows, self._names = rows, names

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __getitem__(self, name: str) -> Row:
        row: Row = self._rows[name]
        return row

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)
