"""Replay of a measured demand, which compares a model's response with the measurement."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.bench.experiment import without_step
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit
from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.model import Model
from bywire.core.signals import signals_of
from bywire.core.units import difference_unit
from bywire.data.named_columns import NamedColumns
from bywire.identification.bench_replay import Replayed
from bywire.identification.replay_fit import (
    Segment,
    SegmentFit,
    found_in,
    read_segments,
    undefined,
    whole_record,
)
from bywire.identification.tracking import Track
from bywire.report.answer import Answer, FigureAt, Outcome, outcome_of
from bywire.report.document import (
    Attachment,
    Banner,
    Document,
    FigureBlock,
    Listing,
    Section,
    TableBlock,
    spaced,
)
from bywire.report.subject import Subject
from bywire.report.tables import Cell, Column, Table, measured_cell
from bywire.report.wording import amount, clean

_SHOWN = ("nrmse", "vaf", "max_error", "bias", "lag")


@dataclass(frozen=True)
class Replay(Answer):
    """A measured response and the model's response to the same demand.

    Parameters
    ----------
    bench, source
        The model, and the measurement in one line.
    replayed
        Inputs, and each output as measured and modeled.
    fits
        Figures of every signal and segment, with the tolerances.
    tracks
        Tracked drifting parameters.
    data_notes
        Notes on the processing of the measurement.
    """

    bench: Bench
    source: str
    replayed: Replayed
    fits: tuple[SegmentFit, ...]
    tracks: tuple[Track, ...] = ()
    data_notes: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether every tolerance is met."""
        return all(v.met for fit in self.fits for v in fit.verdicts)

    @property
    def key_figures(self) -> list[FigureAt]:
        """Figures of every signal and segment, named ``SIGNAL.FIGURE``."""
        return [
            FigureAt(replace(kpi, name=f"{fit.signal}.{kpi.name}"), fit.segment.name)
            for fit in self.fits
            for kpi in fit.kpis
        ]

    @property
    def own_limits(self) -> list[Limit]:
        """Tolerances of every signal."""
        limits = (
            replace(verdict.required, figure=f"{fit.signal}.{verdict.kpi}")
            for fit in self.fits
            for verdict in fit.verdicts
        )
        return list(dict.fromkeys(limits))

    @property
    def outcome(self) -> Outcome:
        """Verdict on the tolerances; ``not shown`` without any."""
        return outcome_of([v.outcome for fit in self.fits for v in fit.verdicts])

    @property
    def notes(self) -> list[str]:
        """Notes on the measurement, assumptions, and undefined figures."""
        return [*self.data_notes, *self.replayed.notes, *undefined(self.fits)]

    @property
    def recording(self) -> xr.Dataset:
        """Inputs, and each output as ``NAME_measured`` and ``NAME_modeled``, over ``time`` [s]."""
        signals = {
            f"{name}_{kind}": pair[kind]
            for name, pair in self.replayed.outputs.items()
            for kind in ("measured", "modeled")
        }
        return xr.Dataset({**signals, **{str(n): v for n, v in self.replayed.inputs.items()}})

    def document(self) -> Document:
        """Return the fit by segment, with figures and tracked parameters."""
        bench, inputs = self.bench, ", ".join(map(str, self.replayed.inputs.data_vars))
        subject = Subject.of_bench(bench)
        table = TableBlock(_fit_table(self.fits))
        definitions = [f"{k.name}: {k.definition}" for k in self.fits[0].kpis] if self.fits else []
        head = f"{self.source} drives {bench.experiment} of {bench.parameters} through {inputs}"
        return Document(
            f"Replay of {self.source}",
            subject.line,
            sections=lambda: [
                Section("Fit", [table, Listing(definitions)]),
                Section("Measured and simulated", self._figures()),
                *([Section("Tracked parameters", self._track_figures())] if self.tracks else []),
                subject.provenance(
                    f"Measurement: {self.source}.",
                    *(f"{note[:1].upper()}{note[1:]}." for note in self.notes),
                ),
            ],
            brief=spaced([f"{self._verdict()}.", head, table, *self._tracked_texts()]),
            data=self._data(),
            banner=self._banner(),
            attachments=[Attachment("replay.nc", self._write_signals)],
            record="replay.json",
            changes=subject.changes,
        )

    def _figures(self) -> list[FigureBlock]:
        from bywire.report.estimate_figures import replay_figure

        return [
            FigureBlock(
                partial(
                    replay_figure,
                    name,
                    pair,
                    self.replayed.inputs,
                    [fit for fit in self.fits if fit.signal == name],
                ),
                f"{name}: measured (solid), simulated (dashed), and their difference. The demand "
                f"is at the top.",
                name,
            )
            for name, pair in self.replayed.outputs.items()
        ]

    def _track_figures(self) -> list[FigureBlock]:
        from bywire.report.estimate_figures import track_figure

        known = self.replayed.run.par.leaves()
        return [
            FigureBlock(
                partial(track_figure, each, known.get(each.relation.parameter)),
                f"{each.relation.parameter} tracked from {', '.join(each.relation.signals)}: "
                f"{each.relation.assumption}.",
                f"track-{each.relation.parameter}",
            )
            for each in self.tracks
        ]

    def _tracked_texts(self) -> Iterator[str]:
        for each in self.tracks:
            data, unit = each.data.isel(parameter=0), each.relation.units[0]
            updated = data.isel(time=data["used"].values > 0)
            if updated.sizes["time"]:
                first, last = (
                    f"{amount(float(updated['value'][k]), unit)} "
                    f"({amount(float(updated['low'][k]), unit)} "
                    f"to {amount(float(updated['high'][k]), unit)})"
                    for k in (0, -1)
                )
                yield f"{each.relation.parameter} tracked: {first} at the start, {last} at the end"

    def _banner(self) -> Banner:
        is_judged = any(fit.verdicts for fit in self.fits)
        return Banner(self._verdict(), ("good" if self.holds else "bad") if is_judged else "none")

    def _verdict(self) -> str:
        """Return the verdict as text, with the maximum difference and its time."""
        outcomes = [v.outcome for fit in self.fits for v in fit.verdicts]
        if not outcomes:
            worst = self._worst(self.fits)
            return f"No tolerance is set{worst and f'. Maximum difference: {worst}'}"
        if self.holds:
            return (
                "The model reproduces the record within the tolerance"
                if len(outcomes) == 1
                else f"The model reproduces the record within all {len(outcomes)} tolerances"
            )
        counted = ((outcomes.count(word), word) for word in ("missed", "undecided"))
        open_ = " and ".join(
            f"{count} {'is' if count == 1 else 'are'} {word}" for count, word in counted if count
        )
        failing = [fit for fit in self.fits if any(v.outcome != "met" for v in fit.verdicts)]
        worst = self._worst(failing)
        reproduces = "does not reproduce" if "missed" in outcomes else "may not reproduce"
        return (
            f"The model {reproduces} the record: of {len(outcomes)} tolerances, {open_}"
            f"{worst and f'. Worst: {worst}'}"
        )

    def _worst(self, fits: Iterable[SegmentFit]) -> str:
        """Return the maximum difference relative to its signal's range, as text with its time."""
        places = []
        for fit in fits:
            pair = self.replayed.outputs[fit.signal]
            time = pair["time"].values
            within = (time >= fit.segment.start) & (time <= fit.segment.stop)
            off = np.abs((pair["modeled"] - pair["measured"]).values[within])
            if not np.isfinite(off).any():
                continue
            k = int(np.nanargmax(off))
            reach = float(np.ptp(pair["measured"].dropna("time").values)) or 1.0
            unit = difference_unit(str(pair["measured"].attrs.get("units", "1")))
            size = f"{fit.signal} differs by {amount(float(off[k]), unit, 3)}"
            places.append((off[k] / reach, f"{size} at t = {amount(float(time[within][k]), 's')}"))
        return max(places)[1] if places else ""

    def _data(self) -> dict[str, Any]:
        return {
            "bench": self.bench.name or self.bench.experiment,
            "measurement": self.source,
            "inputs": [str(name) for name in self.replayed.inputs.data_vars],
            "notes": self.notes,
            "holds": self.holds,
            "segments": [
                {
                    "name": fit.segment.name,
                    "signal": fit.signal,
                    "start": fit.segment.start,
                    "stop": fit.segment.stop,
                    "figures": {
                        k.name: {
                            "value": k.value,
                            "unit": k.unit,
                            "error": k.error,
                            "converges": k.converges,
                        }
                        for k in fit.kpis
                    },
                    "tolerances": [
                        {
                            "figure": v.kpi,
                            "limit": v.limit,
                            "value": v.value,
                            "met": v.met,
                            "outcome": v.outcome,
                            "error": v.error,
                        }
                        for v in fit.verdicts
                    ],
                }
                for fit in self.fits
            ],
            "tracked": {each.relation.parameter: _tracked(each) for each in self.tracks},
        }

    def _write_signals(self, path: Path) -> Path:
        from bywire.data.netcdf import write_recording

        return write_recording(self.recording, path)


def _fit_table(fits: Sequence[SegmentFit]) -> Table:
    """Return the figures of every signal and segment, with missed tolerances."""
    rows = []
    for fit in fits:
        by_name = {k.name: k for k in fit.kpis}
        failed = {
            word: [
                f"{v.kpi} {v.limit}{' (not defined)' if math.isnan(v.value) else ''}"
                for v in fit.verdicts
                if v.outcome == word
            ]
            for word in ("missed", "undecided")
        }
        text = "; ".join(f"{word}: {', '.join(each)}" for word, each in failed.items() if each)
        verdict = Cell("-")
        if fit.verdicts:
            verdict = Cell(text, "bad") if text else Cell("ok", "good")
        rows.append(
            (
                Cell(clean(fit.segment.name)),
                Cell(clean(fit.signal)),
                *(_figure(by_name[n]) for n in _SHOWN),
                verdict,
            )
        )
    numbers = (Column(name.replace("_", " "), numeric=True) for name in _SHOWN)
    return Table((Column("segment"), Column("signal"), *numbers, Column("tolerances")), tuple(rows))


def _figure(kpi: Kpi) -> Cell:
    if kpi.unit == "s" and math.isfinite(kpi.value) and not kpi.bound > 0.0:
        return Cell(amount(kpi.value, "s", 3), value=kpi.value, unit=kpi.unit)
    return measured_cell(kpi.value, kpi.unit, kpi.bound, 3)


def _tracked(track: Track) -> dict[str, Any]:
    data = track.data.isel(parameter=0)
    return {
        "unit": track.relation.units[0],
        "from": list(track.relation.signals),
        "assumption": track.relation.assumption,
        "time": data["time"].values.tolist(),
        **{n: data[n].values.tolist() for n in ("value", "low", "high")},
        "used": data["used"].values.tolist(),
    }


# --- The replay

_NONE: Mapping[str, Any] = MappingProxyType({})
_SILENT = {"kind": "step", "start": "0", "end": "0", "t_step": "0"}


def columns_of_bench(
    inputs: Mapping[str, str], columns: Mapping[str, str], time: str, units: Mapping[str, str]
) -> NamedColumns:
    """Return the named columns of a bench's inputs and outputs.

    An input keeps its column's name. An output gets the model's name.

    Parameters
    ----------
    inputs, columns
        Column of each stimulus, and of each output with a named column.
    time
        Time column.
    units
        SI unit of every needed signal, by name.

    Raises
    ------
    ParameterError
        If one name refers to two columns.
    """
    driving = {column: stimulus for stimulus, column in inputs.items()}
    for name, column in columns.items():
        if name in driving and column != name:
            raise ParameterError(
                f"{name} is ambiguous: it is the column that drives {driving[name]}, and also the "
                f"name of column {column}. Write the first column with its unit, for example "
                f"{option('inputs', {driving[name]: f'{name}[UNIT]'})}",
                name=name,
                value=column,
            )
    return NamedColumns({**{c: c for c in driving}, **columns}, time, units, driving)


def units_of(model: Model, inputs: Mapping[str, str], outputs: Iterable[str]) -> dict[str, str]:
    """Return the SI units of the signals that a replay may need, by name."""
    stimuli, known = signals_of(model.Stimulus), signals_of(model.Output)
    units = {name: signal.unit for name, signal in {**known, **stimuli}.items()}
    wanted = {**dict.fromkeys(outputs or known), **dict.fromkeys([] if inputs else stimuli)}
    given = {column: stimuli[name].unit for name, column in inputs.items() if name in stimuli}
    return {name: units[name] for name in wanted if name in units} | given


def driven_bench(bench: Bench | str | Path, changes: Mapping[str, Any]) -> Bench:
    """Return a bench with zero for missing stimuli, because the measurement replaces them.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or an experiment's name.
    changes
        Changes in the same form as ``--set``.

    Raises
    ------
    InputError
        If the bench cannot be read, or a change is invalid.
    """
    driven = _driven_bench(bench, changes)
    if math.isnan(driven.step):
        raise without_step("bywire chooses steps for the stimulus of a bench, not for measurements")
    return driven


def _driven_bench(bench: Bench | str | Path, changes: Mapping[str, Any]) -> Bench:
    if isinstance(bench, Bench):
        return bench.with_overrides(changes) if changes else bench
    try:
        return bench_file.read(bench, changes)
    except ParameterError as error:
        if "[stimulus]" not in str(error):
            raise
    silent = {f"stimulus.{key}": value for key, value in _SILENT.items()}
    return bench_file.read(bench, {**silent, **changes})


def stretches_of(
    wanted: str | Path, inputs: xr.Dataset, limits: Mapping[str, str]
) -> list[Segment]:
    """Return the segments to evaluate: from a file, detected, or the whole record."""
    if not wanted:
        return whole_record(inputs["time"].values, limits)
    if wanted == "auto":
        return found_in(next(iter(inputs.data_vars.values())), limits)
    return read_segments(wanted, limits)
