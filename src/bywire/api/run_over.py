"""Results of a bench over a range of one number: key figures, verdicts, overlaid curves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from bywire.api.loop_case import spread
from bywire.api.run_sections import choice_data, choice_texts, fault_texts
from bywire.bench.bench import Bench
from bywire.bench.ensemble import changed, run_benches, varied_leaf
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit, Verdict
from bywire.bench.result_folder import kpi_record, verdict_record
from bywire.bench.running import Result
from bywire.bench.step_choice import exceeded, spread_over, with_chosen_step
from bywire.bench.step_error import are_distinct
from bywire.core.errors import ParameterError
from bywire.core.typing import Array, Progress
from bywire.report.answer import Answer, FigureAt, Outcome, outcome_of
from bywire.report.document import (
    Attachment,
    Banner,
    Block,
    Document,
    FigureBlock,
    Listing,
    Section,
    TableBlock,
    recording_file,
    spaced,
)
from bywire.report.subject import Subject
from bywire.report.tables import Cell, Column, Table, amount_cell
from bywire.report.wording import amount, clean, measured_amount

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLUMNS = 5  # key figures side by side on a terminal


@dataclass(frozen=True)
class BenchRange(Answer):
    """Results of a bench for every value of a range.

    Parameters
    ----------
    bench
        The bench without the range.
    name, unit, values
        Varied parameter or ``options.NAME``, its SI unit and its values.
    results
        Result of each value, with recordings, key figures and verdicts.
    """

    bench: Bench
    name: str
    unit: str
    values: tuple[float, ...]
    results: tuple[Result, ...]

    @property
    def holds(self) -> bool:
        """Whether every requirement is met at every value."""
        return all(v.met for result in self.results for v in result.verdicts)

    @property
    def key_figures(self) -> list[FigureAt]:
        """The key figures at every value of the range."""
        return [
            FigureAt(kpi, f"{self.name} = {amount(value, self.unit)}")
            for value, result in zip(self.values, self.results, strict=True)
            for kpi in result.kpis
        ]

    @property
    def own_limits(self) -> list[Limit]:
        """Limits of the bench's requirements."""
        return list(self.bench.limits.values())

    @property
    def outcome(self) -> Outcome:
        """Verdict on the bench's requirements at every value; ``not shown`` without any."""
        return outcome_of([v.outcome for result in self.results for v in result.verdicts])

    @property
    def warnings(self) -> list[str]:
        """Warnings of the runs, with their values."""
        warned: dict[str, list[float]] = {}
        for value, result in zip(self.values, self.results, strict=True):
            for text in (*result.bench.outdated, *result.warnings, exceeded(result)):
                warned.setdefault(text, []).append(value)
        return [f"{text} ({self._at(values)})" for text, values in warned.items() if text]

    def kpi(self, name: str) -> Array:
        """Return a key figure for every value, shape (values,), NaN where it is not defined.

        Raises
        ------
        UnknownNameError
            If the name is unknown. The message lists the closest matches.
        """
        return np.array([result.kpi(name).value for result in self.results])

    @property
    def recordings(self) -> dict[str, xr.Dataset]:
        """Recordings by label, over dimensions case and time, with the value of each case."""
        labels = dict.fromkeys(label for result in self.results for label in result.recordings)
        return {
            label: xr.concat(
                [r.recordings[label] for r in self.results if label in r.recordings],
                dim="case",
                join="outer",
                combine_attrs="drop_conflicts",
            ).assign_coords({self.name: ("case", self._values_of(label), {"units": self.unit})})
            for label in labels
        }

    def document(self) -> Document:
        """Return key figures by value, verdicts and curves."""
        bench = self.bench
        kpis = self._kpis()
        title = bench.name or bench.experiment
        subject = Subject.of_bench(bench, varied=[self.name])
        pieces = [kpis[k : k + _COLUMNS] for k in range(0, len(kpis), _COLUMNS)]
        tables = [TableBlock(self._table(piece)) for piece in pieces]
        judged = list(self._judged())
        listing = [Listing([text for _, text in judged], "Requirements:")] if judged else []
        listing += [Listing(said)] if (said := self._indistinct()) else []
        said = [*choice_texts(bench), *fault_texts(bench)]
        faults = [Listing(said)] if said else []
        return Document(
            f"{title} over {self.name}",
            subject.line,
            sections=lambda: [
                Section("Key figures", [*faults, *listing, TableBlock(self._table(kpis))]),
                Section("Figures", self._figures()),
                subject.provenance(f"Engine: {', '.join(self._engines())}."),
            ],
            brief=spaced([*faults, *tables, *listing]),
            data=self._data(),
            banner=self._banner(),
            attachments=[
                Attachment(f"{label}.nc", partial(self._write, label))
                for label in dict.fromkeys(n for r in self.results for n in r.recordings)
            ],
            record="range.json",
            remarks=[
                f"requirement {'undecided' if outcome == 'undecided' else 'not met'}: {text}"
                for outcome, text in judged
                if outcome != "met"
            ],
            changes=subject.changes,
        )

    def _write(self, label: str, path: Any) -> Any:
        return recording_file(path.name, self.recordings[label]).write(path)

    def _values_of(self, label: str) -> list[float]:
        pairs = zip(self.values, self.results, strict=True)
        return [value for value, result in pairs if label in result.recordings]

    def _at(self, values: Sequence[float]) -> str:
        if len(values) == len(self.values):
            return f"at all {len(values)} values of {self.name}"
        low, high = (amount(v, self.unit) for v in (values[0], values[-1]))
        where = low if len(values) == 1 else f"{len(values)} values from {low} to {high}"
        return f"at {self.name} = {where}"

    def _kpis(self) -> list[Kpi]:
        """Return the key figures of all values, each from the first value that has it."""
        return list({kpi.name: kpi for r in reversed(self.results) for kpi in r.kpis}.values())

    @cached_property
    def _distinct(self) -> dict[str, bool]:
        """Whether each key figure differs anywhere by more than its numerical error."""
        by_name: dict[str, list[Kpi]] = {}
        for result in self.results:
            for kpi in result.kpis:
                by_name.setdefault(kpi.name, []).append(kpi)
        return {
            name: are_distinct([kpi.value for kpi in each], [kpi.bound for kpi in each])
            for name, each in by_name.items()
        }

    def _indistinct(self) -> list[str]:
        """Return a sentence on figures whose changes may be numerical errors, if there are any."""
        names = [
            kpi.name
            for kpi in self._kpis()
            if not self._distinct[kpi.name] and np.ptp(self.kpi(kpi.name)) > 0.0  # NaN is not
        ]
        if not names:
            return []
        return [f"no change over {self.name} beyond the numerical error: {', '.join(names)}"]

    def _table(self, kpis: Sequence[Kpi]) -> Table:
        """Return some key figures, one row per value, with missed limits marked."""
        limits = self.bench.requirements
        heads = [Column(f"{k.name} {limits.get(k.name, '')}".strip(), numeric=True) for k in kpis]
        rows = [
            (
                amount_cell(value, self.unit),
                *(_cell(kpi.name, result) for kpi in kpis),
            )
            for value, result in zip(self.values, self.results, strict=True)
        ]
        return Table((Column(clean(self.name), numeric=True), *heads), tuple(rows))

    def _verdicts(self) -> dict[str, list[tuple[float, Verdict]]]:
        verdicts: dict[str, list[tuple[float, Verdict]]] = {}
        for value, result in zip(self.values, self.results, strict=True):
            for verdict in result.verdicts:
                verdicts.setdefault(verdict.kpi, []).append((value, verdict))
        return verdicts

    def _judged(self) -> Iterator[tuple[str, str]]:
        """Yield the outcome of each requirement over all values, and a sentence on it."""
        for name, pairs in self._verdicts().items():
            at = {
                outcome: [(value, each) for value, each in pairs if each.outcome == outcome]
                for outcome in ("missed", "undecided")
            }
            head = f"{name} {pairs[0][1].limit}"
            texts = [f"{outcome} {self._worst(open_)}" for outcome, open_ in at.items() if open_]
            if texts:
                yield ("missed" if at["missed"] else "undecided"), f"{head}: {'; '.join(texts)}"
            else:
                yield "met", f"{head}: met {self._at([value for value, _ in pairs])}"

    def _worst(self, pairs: Sequence[tuple[float, Verdict]]) -> str:
        """Return the values with an outcome of a requirement, and the worst figure there."""
        where = self._at([value for value, _ in pairs])
        known = [(value, each) for value, each in pairs if math.isfinite(each.value)]
        if not known:
            return f"{where}: {pairs[0][1].note}" if pairs[0][1].note else where
        sign = -1.0 if pairs[0][1].required.is_upper else 1.0
        value, worst = min(known, key=lambda pair: sign * pair[1].value)
        return f"{where}, worst {amount(worst.value, worst.unit)} at {amount(value, self.unit)}"

    def _banner(self) -> Banner:
        if not self.bench.requirements:
            return Banner(f"done for {len(self.values)} values")
        statuses = [result.status for result in self.results]
        text = f"all requirements met at {statuses.count('passed')} of {len(self.values)} values"
        if open_ := statuses.count("undecided"):
            text += f", undecided at {open_}"
        return Banner(text, "good" if self.holds else "bad" if "failed" in statuses else "open")

    def _figures(self) -> list[Block]:
        from bywire.report.range_figures import kpi_curves
        from bywire.report.time_traces import can_overlay

        captions = {
            "curves": "Curves for all values. The color scale shows the values.",
            "kpis": "Key figures versus the value, with their numerical error where it is "
            "visible. Dotted lines show the limit. Crosses miss it. Key figures that are constant "
            "or undefined are "
            "omitted.",
        }
        blocks: list[Block] = [
            FigureBlock(partial(kpi_curves, self), captions["kpis"], "key-figures")
        ]
        labels = dict.fromkeys(label for result in self.results for label in result.recordings)
        for label in labels:
            each = [r.recordings[label] for r in self.results if label in r.recordings]
            if can_overlay(each):
                name = f"overlay-{label}" if len(labels) > 1 else "overlay"
                caption = captions["curves"] + (f" Run: {label}." if len(labels) > 1 else "")
                blocks.append(FigureBlock(partial(self._drawn, label, each), caption, name))
        return blocks

    def _drawn(self, label: str, recordings: Sequence[xr.Dataset]) -> Figure:
        from bywire.report.step_response import step_limits
        from bywire.report.time_traces import Scale, overlaid_panels

        steps = [
            step_limits(r.bench.definition, r.bench.chosen_options, r.verdicts)
            for r in self.results
        ]
        shared = steps[0] if all(each == steps[0] for each in steps) else None
        values = self._values_of(label)
        named = {amount(v, self.unit, 6): r for v, r in zip(values, recordings, strict=True)}
        scale = Scale(self.name, self.unit, tuple(values))
        return overlaid_panels(named, step=shared, scale=scale)

    def _engines(self) -> list[str]:
        each = [r.attrs.get("engine") for k in self.results for r in k.recordings.values()]
        return [str(text) for text in dict.fromkeys(each) if text]

    def _data(self) -> dict[str, Any]:
        return {
            "bench": self.bench.name or self.bench.experiment,
            "over": self.name,
            "unit": self.unit,
            "cases": [
                {
                    "value": value,
                    "status": result.status,
                    "kpis": {kpi.name: kpi_record(kpi) for kpi in result.kpis},
                    "requirements": [verdict_record(verdict) for verdict in result.verdicts],
                }
                for value, result in zip(self.values, self.results, strict=True)
            ],
            "distinct": self._distinct,
            **choice_data(self.bench),
            "warnings": self.warnings,
        }


def range_of_bench(bench: Bench, over: str) -> tuple[str, str, list[float]]:
    """Return name, SI unit and values of a range ``NAME=LOW:HIGH:COUNT`` for a bench.

    Raises
    ------
    InputError
        If the range is invalid, or the name is not a number of the bench or its options.
    """
    name, equals, text = (part.strip() for part in over.partition("="))
    if not equals:
        raise ParameterError(
            f"over {over!r} is not a range. Write NAME=LOW:HIGH:COUNT, for example "
            "motor.R_m=0.2ohm:0.6ohm:9",
            name="over",
            value=repr(over),
            valid="NAME=LOW:HIGH:COUNT",
        )
    leaf = varied_leaf(bench, name)
    bench.require_effect(name)
    values = spread(text, leaf.unit.symbol, name)
    if len({*values}) < 2:
        raise ParameterError(
            f"over {over!r} needs at least two different values", name="over", value=repr(over)
        )
    return name, leaf.unit.symbol, values


def run_over(
    bench: Bench, over: str, progress: Progress | None, engine: str, estimate_error: bool
) -> BenchRange:
    """Return a bench's results for every value of ``NAME=LOW:HIGH:COUNT`` (see `bywire.run`).

    Raises
    ------
    InputError
        If the range is invalid, the name is not a number of the bench or its options, or the bench
        rejects a value.
    RunError
        If a run fails.
    KeyboardInterrupt
        If interrupted.
    """
    name, unit, values = range_of_bench(bench, over)
    cases = [{name: value} for value in values]
    bench = with_chosen_step(bench, spread_over(cases), progress, engine)
    benches = [changed(bench, case) for case in cases]
    results = run_benches(benches, progress, engine, estimate_error=estimate_error)
    return BenchRange(bench, name, unit, tuple(values), results)


def _cell(name: str, result: Result) -> Cell:
    known: Mapping[str, Kpi] = {kpi.name: kpi for kpi in result.kpis}
    if name not in known:
        return Cell("-")
    kpi = known[name]
    text = measured_amount(kpi.value, kpi.unit, kpi.bound)
    for verdict in result.verdicts:
        if verdict.kpi == name and not verdict.met:
            judged = "missed" if verdict.is_decided else "undecided"
            return Cell(f"{text} {judged}", "bad", kpi.value, kpi.unit)
    return Cell(text, value=kpi.value, unit=kpi.unit)
