"""Which outputs of a model a replay lays beside measured ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case
from bywire.core.callers import option
from bywire.core.errors import ParameterError, UnitError, nearest_first, unknown_name
from bywire.core.signals import Signal, signals_of
from bywire.core.typing import Array
from bywire.data.column_units import measures, unit_of_symbol
from bywire.identification.records import require_signals

_ACCUMULATED = ("J", "s")  # errors of which say when something went wrong, not how well it fits


def compared_outputs(
    case: Case, data: xr.Dataset, wanted: Sequence[str] | None, driven: Mapping[str, str]
) -> tuple[list[str], tuple[str, ...]]:
    """Return which outputs are compared, and what the user should know of it.

    Parameters
    ----------
    case, data
        Run of the model, and what was measured.
    wanted
        Outputs; by default all that are measured and that tell how well the model fits.
    driven
        Stimulus -> measured signal; none of these is compared by default.

    Raises
    ------
    UnknownNameError, UnitError, ParameterError
        When the model has no such output, it is not measured, or there is none.
    """
    signals, there = signals_of(case.model.Output), [str(name) for name in data.data_vars]
    notes: tuple[str, ...] = ()
    if wanted is None:
        known = [n for n in there if n in signals and n not in driven.values()]
        wanted = [n for n in known if _tells(data[n].values, signals[n].unit)] or known
        passed = [n for n in known if n not in wanted]
        if passed:
            notes = (f"left out as flags, sums or constants: {', '.join(passed)}",)
    if not wanted:
        raise ParameterError(
            "nothing measured is an output of the model: name signals as the model does "
            f"({option('mapping')}), "
            f"for instance {', '.join(list(signals)[:6])}; measured are "
            f"{nearest_first(there, signals)}"
        )
    for name in wanted:
        if name not in signals:
            raise unknown_name("output", name, signals)
        require_measured(data, name, signals[name])
    return list(wanted), notes


def _tells(values: Array, unit: str) -> bool:
    """Return whether a signal moves and is neither a flag nor accumulated."""
    there = values[np.isfinite(values)]
    if unit in _ACCUMULATED or not there.size or np.ptp(there) == 0.0:
        return False
    return not (unit == "1" and bool(np.all(there == np.round(there))))


def missed_samples(data: xr.Dataset, compared: Sequence[str]) -> list[str]:
    """Return a sentence for each compared signal that misses samples."""
    counts = {name: int(np.isnan(data[name].values).sum()) for name in compared}
    total = data.sizes["time"]
    return [
        f"{name} misses {count} of {total} samples ({100.0 * count / total:.2g} %), where nothing "
        "is compared"
        for name, count in counts.items()
        if count
    ]


def require_measured(data: xr.Dataset, name: str, signal: Signal) -> None:
    """Refuse a signal that is not measured, or in a unit of something else."""
    require_signals(data, [name])
    unit = str(data[name].attrs.get("units", "1"))
    if unit != signal.unit and not measures(unit_of_symbol(unit), signal.unit):
        raise UnitError(f"{name} is measured in {unit}, but {signal.unit} is wanted: check the map")
