"""Several records of one experiment in one measurement, one after the other.

The signal ``record`` numbers them, 0, 1, ...; its attribute ``flag_meanings`` names them, as the
Climate and Forecast conventions write it; ``begins`` says when each began on its own clock, while
they are in memory. Time goes on from one record to the next, so that any file can hold them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from bywire.core.errors import ParameterError, unknown_name
from bywire.core.typing import Array

RECORD = "record"
"""the signal that numbers the records"""


def require_signals(data: xr.Dataset, names: Iterable[str]) -> None:
    """Raise ``UnknownNameError`` when a signal is not measured, with the nearest ones."""
    for name in names:
        if name not in data:
            raise unknown_name("measured signal", name, [str(k) for k in data.data_vars])


def joined(records: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return records as one measurement; a single one stays as it is.

    Parameters
    ----------
    records
        By label; each over ``time`` [s], with the same signals.

    Raises
    ------
    ParameterError
        When there is none, or one has other signals than the first.
    """
    if not records:
        raise ParameterError("no record is given: one at least is needed")
    first, *others = records
    if not others:
        return records[first]
    wanted = set(map(str, records[first].data_vars))
    parts, times, start = [], [], 0.0
    for number, (label, record) in enumerate(records.items()):
        if set(map(str, record.data_vars)) != wanted:
            differing = ", ".join(sorted(wanted ^ set(map(str, record.data_vars))))
            raise ParameterError(
                f"records {first} and {label} differ in their signals ({differing}): records of "
                "one experiment have the same ones"
            )
        t = record["time"].values - record["time"].values[0]
        times.append(start + t)
        start = float(times[-1][-1] + (t[1] - t[0] if t.size > 1 else 1.0))
        parts.append(record.assign({RECORD: ("time", np.full(t.size, float(number)))}))
    whole = xr.concat(parts, "time", combine_attrs="override")
    axis = pd.Index(np.concatenate(times), name="time")
    whole = whole.assign_coords(time=("time", axis, {"units": "s", "long_name": "time"}))
    names = " ".join(label.replace(" ", "_") for label in records)
    begins = [float(record["time"].values[0]) for record in records.values()]
    whole[RECORD].attrs = {
        "units": "1",
        "long_name": "record",
        "flag_meanings": names,
        "begins": begins,
    }
    return whole


def split(data: xr.Dataset, own_clock: bool = False) -> dict[str, xr.Dataset]:
    """Return the records of a measurement by label, each with a time that begins at zero.

    Without the signal ``record`` it is one record without a name, as it is.

    Parameters
    ----------
    data
        The measurement.
    own_clock
        Whether each record's time begins where it did before they were joined.
    """
    if RECORD not in data:
        return {"": data}
    numbers = data[RECORD].values
    names = str(data[RECORD].attrs.get("flag_meanings", "")).split()
    begins = np.atleast_1d(data[RECORD].attrs.get("begins", [])) if own_clock else np.empty(0)
    records = {}
    for number in np.unique(numbers[np.isfinite(numbers)]):
        k = int(number)
        record = data.isel(time=np.flatnonzero(numbers == number)).drop_vars(RECORD)
        begin = begins[k] if k < begins.size else 0.0
        t = record["time"].values - record["time"].values[0] + begin
        axis = pd.Index(np.round(t, 12), name="time")
        label = names[k] if 0 <= k < len(names) else f"record_{k}"
        clock = ("time", axis, {"units": "s", "long_name": "time"})
        records[label] = record.assign_coords(time=clock)
    return records


def after_one_another(times: Mapping[str, Array]) -> dict[str, Any]:
    """Return coordinates for records in a row: ``time``, which goes on, and ``record``, the names.

    Parameters
    ----------
    times
        By record: instants within it [s], shape (n_k,), ascending; not all of its samples need
        be there. A single record without a name gets no ``record``.
    """
    begin, axis, names = 0.0, [], []
    for name, t in times.items():
        if t.size:
            axis.append(begin + t)
            begin = float(axis[-1][-1]) + (float(np.median(np.diff(t))) if t.size > 1 else 0.0)
        names += [name] * t.size
    attrs = {
        "units": "s",
        "long_name": "time, records in a row" if len(times) > 1 else "time",
    }
    coordinates: dict[str, Any] = {"time": ("time", np.concatenate(axis), attrs)}
    if len(times) > 1:
        coordinates["record"] = ("time", np.array(names))
    return coordinates
