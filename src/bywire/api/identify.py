"""Parameters from measurements, by a named method or by one of any bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import xarray as xr

from bywire.api import earlier_result
from bywire.api.identification import Identification
from bywire.api.method_choice import ChosenMethod, Source, choose, columns_of
from bywire.core.blas import on_one_thread
from bywire.core.errors import ParameterError
from bywire.data.file_format import Progress, no_progress
from bywire.data.named_columns import NamedColumns
from bywire.identification.fitting.question import Question
from bywire.identification.measured import Measured, measured, name_of, require_signals
from bywire.identification.method import Effort, Identified
from bywire.identification.trust import displaced, put_in
from bywire.report.answer import use_case

if TYPE_CHECKING:
    from bywire.core.parameters import ParameterSet

STARTS = "starts.jsonl"
"""file of the output folder that keeps finished starts"""

_NONE: Mapping[str, Any] = MappingProxyType({})
_NOTHING = Question()
_FAR = 30.0  # times: beyond, a unit is the first suspect


@use_case
@on_one_thread()
def identify(
    method: str,
    measurements: Source | Sequence[Source] = (),
    parameters: str = "",
    overrides: Mapping[str, Any] = _NONE,
    *,
    question: Question = _NOTHING,
    mapping: str | Path | None = None,
    time: str = "",
    options: Mapping[str, Any] = _NONE,
    starts: int = 16,
    seed: int = 1,
    synthetic: int | None = None,
    folder: str | Path | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify parameters from a measured or a simulated experiment.

    Parameters
    ----------
    method
        Name of the method, see ``bywire list``.
    measurements
        A measurement or several records of it: files, or what `bywire.read_measurement` gives.
    parameters, overrides
        Parameter set from which the search begins (of the method's brake, the main one by
        default), and what of it is changed: SI numbers, or texts with units.
    question
        For methods of any bench: which one, what is measured there, and what is unknown. Of a
        method of a brake's own, ``outputs`` may name the columns of its signals.
    mapping
        File that says what the columns of measurement files mean.
    time
        Column of the instants, such as ``"Zeit [s]"``, or a sample rate; that of the file by
        default.
    options
        Options of the method, likewise.
    starts, seed
        Starts of the search, and the seed of all but the first.
    synthetic
        Seed of a simulated measurement, which is identified in place of a measured one.
    folder
        Where the result will be written: a folder with the result of another method is refused, an
        earlier result is removed, and finished starts are kept there, so that an interrupted
        search goes on.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    Identification
        Parameters in SI units with their 95 % intervals, the checks of the result, and what it was
        identified from.

    Raises
    ------
    InputError
        When something that is asked for does not fit, or a measurement cannot be used.
    KeyboardInterrupt
        When interrupted.

    Examples
    --------
    >>> import bywire
    >>> found = bywire.identify("seal-friction", synthetic=1)
    >>> found.holds
    True
    >>> list(found.tables()["Seal friction"]["parameter"])
    ['A', 'F_0', 'f']
    """
    sources = [measurements] if isinstance(measurements, Source) else list(measurements)
    shown = no_progress if progress is None else progress
    chosen = choose(
        method,
        parameters,
        overrides,
        options,
        question,
        measurements=sources,
        mapping=mapping,
        time=time,
        progress=shown,
    )
    named = columns_of(chosen.method, question, time)
    _require_one_source(chosen, sources, synthetic, mapping, time)
    place = None if folder is None else Path(folder)
    if place is not None:
        earlier_result.require_own(place, method)
    data, source = _data(chosen, sources, mapping, named, synthetic, shown)
    files = tuple(
        Path(each) for each in (*sources, question.holdout) if isinstance(each, str | Path)
    )
    if place is not None:
        earlier_result.remove(place, files)
    start = _start(chosen, synthetic)
    store = None if place is None else place / STARTS
    effort = Effort(starts=starts, seed=seed, store=store, progress=shown)
    identified = _identified(chosen, start, data.data, effort)
    notes = [*data.notes]
    if chosen.par is not None:
        notes += far_off(identified.parameters, chosen.par.leaves())
    truth: Mapping[str, float] = {}
    if synthetic is not None:
        try:
            truth = put_in(chosen.method, chosen.par, chosen.options)
        except ParameterError as error:
            notes.append(str(error))
    return Identification(
        chosen,
        identified,
        data.data,
        source,
        _begun_at(chosen, start, identified),
        truth,
        tuple(notes),
        synthetic is not None,
        files,
    )


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


def _require_one_source(
    chosen: ChosenMethod,
    sources: Sequence[Source],
    synthetic: int | None,
    mapping: str | Path | None,
    time: str,
) -> None:
    method = chosen.method
    if sources and synthetic is not None:
        raise ParameterError(
            f"{method.name}: give only one of measurement files, --synthetic SEED, --study COUNT"
        )
    if not sources and synthetic is None:
        signals = ", ".join(f"{n} [{unit}]" for n, unit in method.signals.items())
        raise ParameterError(
            f"{method.name} needs one of: measurement files with the signals {signals}, "
            "--synthetic SEED, or --study COUNT"
        )
    for flag, given in {"--map": mapping is not None, "--time": bool(time)}.items():
        if given and not sources:
            raise ParameterError(f"{flag} is for measurement files: leave it out")


def _data(
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


def _start(chosen: ChosenMethod, synthetic: int | None) -> ParameterSet | None:
    """Return the parameters from which the search begins: off those that were put in."""
    if synthetic is None or chosen.par is None:
        return chosen.par
    return displaced(chosen.par, chosen.method.unknowns, Effort().spread, synthetic)


def _identified(
    chosen: ChosenMethod, start: ParameterSet | None, data: xr.Dataset, effort: Effort
) -> Identified:
    require_signals(data, chosen.method.signals)
    try:
        return chosen.method.identify(data, start, chosen.options, effort)
    except KeyboardInterrupt:
        if effort.store is None or not effort.store.exists():
            raise
        raise KeyboardInterrupt(
            f"finished starts are in {effort.store}: the same command goes on from there"
        ) from None


def _begun_at(
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
