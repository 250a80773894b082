"""One variable of a recording, ready to draw: label, display unit, values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.errors import ParameterError, unknown_name
from bywire.core.quantities import display_unit
from bywire.core.typing import Array
from bywire.core.units import convert
from bywire.report.wording import clean

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Channel:
    """A variable in its display unit.

    Parameters
    ----------
    name
        Variable of the recording.
    label
        Its ``long_name``; the name itself where the recording has none.
    symbol
        Its SI unit.
    unit
        The unit of ``values``, in which it is shown.
    time
        Time axis [s], shape ``(n,)``.
    values
        Samples, shape ``(n,)``.
    """

    name: str
    label: str
    symbol: str
    unit: str
    time: Array
    values: Array


def channel(recording: xr.Dataset, name: str) -> Channel:
    """Return a variable of a recording in its display unit.

    Raises
    ------
    UnknownNameError
        When the recording has no such variable.
    ParameterError
        When it has no samples, or more dimensions than time.
    """
    if name not in recording.data_vars:
        raise unknown_name("variable", name, map(str, recording.data_vars))
    array = recording[name]
    if array.dims != ("time",):
        raise ParameterError(
            f"{name} has the dimensions {', '.join(map(str, array.dims)) or 'none'}: a figure "
            "needs time only; select one case first, for instance recording.isel(case=0)"
        )
    if array.size == 0:
        raise ParameterError(f"{name} holds no samples: there is nothing to draw")
    symbol = str(array.attrs.get("units", "1"))
    unit = display_unit(symbol)
    return Channel(
        name=name,
        label=clean(array.attrs.get("long_name", name)),
        symbol=symbol,
        unit=unit,
        time=np.asarray(recording["time"].values, dtype=np.float64),
        values=convert(np.asarray(array.values, dtype=np.float64), symbol, unit),
    )
