"""Parameters from measurements, by a named method or by one of any bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from bywire.api.method_choice import ChosenMethod, Source
from bywire.core.callers import is_command_line, option
from bywire.core.errors import ParameterError
from bywire.data.file_format import Progress
from bywire.data.named_columns import NamedColumns
from bywire.identification.measured import Measured, measured, name_of, require_signals
from bywire.identification.method import Effort, Identified
from bywire.identification.trust import displaced

if TYPE_CHECKING:
    from bywire.core.parameters import ParameterSet

STARTS = "starts.jsonl"
"""file of the output folder that keeps finished starts"""

_FAR = 30.0  # times: beyond, a unit is the first suspect


def far_off(estimates: Mapping[str, float], before: Mapping[str, float]) -> list[str]:
    """Return a note for every parameter that is far from what it was, as by a wrong unit."""
    notes = []
    for name, value in estimates.items():
        known = before.get(name, 0.0)
        ratio = abs(value / known) if known else 1.0
        if ratio > _FAR or ratio * _FAR < 1.0:
            notes.append(
                f"{name} is {ratio:.3g} times what it was before: are the units of the "
                "measurement right (the map's 'unit')?"
            )
    return notes


def require_one_source(
    chosen: ChosenMethod,
    sources: Sequence[Source],
    synthetic: int | None,
    mapping: str | Path | None,
    time: str,
) -> None:
    """Refuse both a measured and a simulated experiment, and neither; and what fits neither.

    Raises
    ------
    ParameterError
        With what is missing, or to be left out.
    """
    method = chosen.method
    study = f"{option('study') if is_command_line() else 'bywire.trust, with count'} COUNT"
    if sources and synthetic is not None:
        raise ParameterError(
            f"{method.name}: give only one of measurement files, {option('synthetic')} SEED, "
            f"{study}"
        )
    if not sources and synthetic is None:
        signals = ", ".join(f"{n} [{unit}]" for n, unit in method.signals.items())
        raise ParameterError(
            f"{method.name} needs one of: measurement files with the signals {signals}, "
            f"{option('synthetic')} SEED, or {study}"
        )
    for name, given in {"mapping": mapping is not None, "time": bool(time)}.items():
        if given and not sources:
            raise ParameterError(f"{option(name)} is for measurement files: leave it out")


def data_of(
    chosen: ChosenMethod,
    sources: Sequence[Source],
    mapping: str | Path | None,
    named: NamedColumns,
    synthetic: int | None,
    progress: Progress,
) -> tuple[Measured, str]:
    """Return the measurement, and what it is in one line."""
    method = chosen.method
    if synthetic is None:
        read = measured(
            sources,
            mapping,
            method.signals,
            optional=method.optional,
            gaps=method.gaps,
            multiple=None if method.bench is None else method.bench.step,
            named=named,
            progress=progress,
        )
        return read, ", ".join(name_of(source) for source in sources)
    progress("simulated experiment", 0.0)
    data = method.synthetic(chosen.par, chosen.options, synthetic)
    progress("simulated experiment", 1.0)
    made_of = f" of {chosen.name}" if chosen.name else ""
    return Measured(data, ()), f"simulated experiment{made_of}, seed {synthetic}"


def start_of(chosen: ChosenMethod, synthetic: int | None) -> ParameterSet | None:
    """Return the parameters from which the search begins: off those that were put in."""
    if synthetic is None or chosen.par is None:
        return chosen.par
    return displaced(chosen.par, chosen.method.unknowns, Effort().spread, synthetic)


def search(
    chosen: ChosenMethod, start: ParameterSet | None, data: xr.Dataset, effort: Effort
) -> Identified:
    """Return what the method finds; an interrupted search says where its starts are kept.

    Raises
    ------
    KeyboardInterrupt
        When interrupted.
    """
    require_signals(data, chosen.method.signals)
    try:
        return chosen.method.identify(data, start, chosen.options, effort)
    except KeyboardInterrupt:
        if effort.store is None or not effort.store.exists():
            raise
        raise KeyboardInterrupt(
            f"finished starts are in {effort.store}: the same command goes on from there"
        ) from None


def begun_at(
    chosen: ChosenMethod, start: ParameterSet | None, identified: Identified
) -> dict[str, float]:
    """Return the values from which the search began, by label."""
    if start is None:
        return {}
    if chosen.method.bench is None:
        return start.leaves()
    # A range that leaves out the bench's own value begins elsewhere.
    return start.leaves() | {
        u.label: u.start for e in identified.estimates.values() for u in e.all_unknowns
    }
