"""Benches beside each other: what differs of settings and key figures, verdicts, curves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from bywire.api.compared_run import ComparedRun, Setting, ran
from bywire.bench import bench_file, running
from bywire.bench.bench import Bench
from bywire.bench.bench_file import names_experiment
from bywire.bench.result_folder import is_result_folder, verdict_record
from bywire.bench.running import Progress, Result
from bywire.bench.step_error import are_distinct
from bywire.core.callers import is_command_line
from bywire.core.errors import ParameterError
from bywire.core.units import difference_unit
from bywire.report.answer import Answer
from bywire.report.document import (
    Block,
    Document,
    FigureBlock,
    Flat,
    Listing,
    Paragraph,
    Section,
    TableBlock,
    spaced,
)
from bywire.report.tables import Cell, Column, Table, measured_cell, value_text
from bywire.report.terminal import change_texts
from bywire.report.wording import clean, duration, measured_amount

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from bywire.report.step_response import StepLimits

_LONGEST = 48  # characters of a value in a table


@dataclass(frozen=True)
class Compared:
    """One setting or key figure of all runs.

    Parameters
    ----------
    name, unit
        What it is called, and its SI unit or ``"%"``.
    values
        Its value in each run; None where a run has no such thing, NaN where it is not defined.
    errors
        How far each value of a key figure may be off by the step, NaN where that was not estimated.
    """

    name: str
    unit: str
    values: tuple[Any, ...]
    errors: tuple[float, ...] = ()

    @property
    def differs(self) -> bool:
        """Whether not all runs have the same value; what is not defined equals itself."""
        first, *others = (_comparable(value) for value in self.values)
        return any(value != first for value in others)

    @property
    def is_distinct(self) -> bool:
        """Whether a key figure differs by more than its errors; they count as independent."""
        values = [math.nan if value is None else value for value in self.values]
        return are_distinct(values, self.errors)


def compared_settings(runs: Sequence[ComparedRun], *, shared_only: bool) -> tuple[Compared, ...]:
    """Return everything that was set, or what all runs have of it."""
    names = list(dict.fromkeys(name for each in runs for name in each.settings))
    if shared_only:
        names = [name for name in names if all(name in each.settings for each in runs)]
    rows = []
    for name in names:
        present = [each.settings.get(name) for each in runs]
        unit = next(each.unit for each in present if each is not None)
        rows.append(Compared(name, unit, tuple(_value(each) for each in present)))
    return tuple(rows)


def compared_figures(runs: Sequence[ComparedRun]) -> tuple[Compared, ...]:
    """Return every key figure that some run has; those of another unit stay apart."""
    keys = dict.fromkeys((kpi.name, kpi.unit) for each in runs for kpi in each.kpis)
    each_run = [{(k.name, k.unit): (k.value, k.bound) for k in each.kpis} for each in runs]
    rows = []
    for name, unit in keys:
        pairs = [known.get((name, unit), (None, math.nan)) for known in each_run]
        rows.append(Compared(name, unit, tuple(v for v, _ in pairs), tuple(e for _, e in pairs)))
    return tuple(rows)


def settings_table(labels: Sequence[str], rows: Sequence[Compared]) -> Table:
    """Return settings of all runs, a column each."""
    return Table(
        (Column("setting"), *(Column(label, numeric=True) for label in labels)),
        tuple(
            (Cell(clean(each.name)), *(_setting(v, each.unit) for v in each.values))
            for each in rows
        ),
    )


def kpi_table(labels: Sequence[str], rows: Sequence[Compared]) -> Table:
    """Return key figures of all runs, a column each, and their change; of many, the spread."""
    change = "change" if len(labels) == 2 else "spread"
    return Table(
        (
            Column("name"),
            *(Column(label, numeric=True) for label in labels),
            Column(change, numeric=True),
        ),
        tuple(
            (
                Cell(clean(each.name)),
                *(
                    measured_cell(v, each.unit, e)
                    for v, e in zip(each.values, each.errors, strict=True)
                ),
                _change(each),
            )
            for each in rows
        ),
    )


def verdict_table(runs: Sequence[ComparedRun]) -> Table:
    """Return the requirements of all runs, one row each, with what every run makes of it."""
    each_run = [{(v.kpi, v.limit): v for v in each.verdicts} for each in runs]
    keys = dict.fromkeys(key for verdicts in each_run for key in verdicts)
    rows = []
    for name, limit in keys:
        cells = []
        for verdicts in each_run:
            verdict = verdicts.get((name, limit))
            if verdict is None:
                cells.append(Cell("-"))
                continue
            shown = measured_amount(verdict.value, verdict.unit, verdict.error)
            text = f"{shown} {verdict.outcome}"
            cells.append(Cell(text, "good" if verdict.met else "bad", verdict.outcome))
        rows.append((Cell(clean(name)), Cell(clean(limit)), *cells))
    columns = (Column("requirement"), Column("limit", numeric=True))
    return Table((*columns, *(Column(each.label, numeric=True) for each in runs)), tuple(rows))


def _change(row: Compared) -> Cell:
    """Return how far two values are apart, or several at most; or that they need not be."""
    known = [value for value in row.values if value is not None and math.isfinite(value)]
    if len(known) < len(row.values):
        return Cell("-")
    is_pair = len(known) == 2
    low, high = (0, 1) if is_pair else (known.index(min(known)), known.index(max(known)))
    first, change = known[low], known[high] - known[low]
    if not row.is_distinct:
        return Cell("not distinct", value=change)
    error = row.errors[low] + row.errors[high]
    written = measured_amount(change, difference_unit(row.unit), error, 3)
    is_share = is_pair and first and row.unit not in ("%", "K")
    share = f" ({100 * change / abs(first):+.3g} %)" if is_share else ""
    sign = "+" if is_pair and change > 0 else ""
    return Cell(f"{sign}{written}{share}", value=change)


def _setting(value: Any, unit: str) -> Cell:
    text = value_text(value, unit)
    return Cell(text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…", value=value)


def _value(setting: Setting | None) -> Any:
    return None if setting is None else setting.value


def _comparable(value: Any) -> Any:
    """Return what compares equal where two values are the same; NaN does not by itself."""
    return "NaN" if isinstance(value, float) and math.isnan(value) else value


# --- The comparison

_FEW = 2  # differing settings that a legend names


@dataclass(frozen=True)
class Comparison(Answer):
    """Benches beside each other.

    Parameters
    ----------
    runs
        What is compared.
    is_full
        Whether what is the same is shown as well.
    """

    runs: tuple[ComparedRun, ...]
    is_full: bool = False

    @cached_property
    def settings(self) -> tuple[Compared, ...]:
        """Everything that was set; of different brakes, what all of them have."""
        return compared_settings(self.runs, shared_only=self._mixed)

    @cached_property
    def figures(self) -> tuple[Compared, ...]:
        """Every key figure that some run has; those of one name but another unit stay apart."""
        return compared_figures(self.runs)

    @property
    def warnings(self) -> list[str]:
        """What makes the comparison weaker than it looks, and what the runs warned of."""
        said = [f"{each.label}: {text}" for each in self.runs for text in each.warnings]
        if self._mixed:
            names = ", ".join(f"{each.label} is a {each.model}" for each in self.runs)
            said.append(
                f"different brakes are compared ({names}): only parameters and signals that they "
                "share are shown"
            )
        said += self._spans()
        grouped = self._groups
        left_out = [
            f"{each.label}: {label}"
            for each in self.runs
            for label in each.recordings
            if not any(each.recordings[label] is r for g in grouped.values() for r in g)
        ]
        if left_out:
            said.append(f"not drawn, for lack of a counterpart over time: {', '.join(left_out)}")
        said += [
            f"{each.label}: its parameter set is not known here, so its values stand without "
            f"units; {'--system PATH' if is_command_line() else 'bywire.load_system'} loads a "
            "brake of your own"
            for each in self.runs
            if not each.has_units
        ]
        return said

    def document(self) -> Document:
        """Return what differs, key figures, verdicts and curves."""
        settings, figures = self._tables()
        verdicts = [TableBlock(verdict_table(self.runs), title="Requirements:")]
        verdicts = verdicts if any(each.verdicts for each in self.runs) else []
        sources = [f"{each.label}: {each.source}" for each in self.runs]
        changed = self._changed()
        changes = [Listing(changed, "Also changed:")] if changed else []
        return Document(
            "Comparison of " + ", ".join(each.label for each in self.runs),
            f"{len(self.runs)} runs; values in the order in which they were given",
            sections=lambda: [
                Section("What differs", [Listing(sources), *settings, *changes]),
                *([Section("Requirements", verdicts)] if verdicts else []),
                Section("Curves", self._curves()),
                *([Section("Differences", apart)] if (apart := self._differences()) else []),
                Section("Key figures", figures),
            ],
            brief=spaced([*settings, *changes, *figures, *verdicts]),
            data=self._data(),
            record="compare.json",
        )

    def _changed(self) -> list[str]:
        """Return what of the runs was changed and is no setting that differs between them."""
        differing = {each.name for each in self.settings if each.differs}
        said: dict[str, list[str]] = {}
        for each in self.runs:
            for text in change_texts([c for c in each.changes if c.name not in differing]):
                said.setdefault(text, []).append(each.label)
        every = len(self.runs)
        return [
            text if len(labels) == every else f"{', '.join(labels)}: {text}"
            for text, labels in said.items()
        ]

    @property
    def _mixed(self) -> bool:
        return len({each.model for each in self.runs}) > 1

    @cached_property
    def _groups(self) -> dict[str, tuple[xr.Dataset, ...]]:
        """The recordings over time that belong together: by label, or each run's only one."""
        over_time = [
            {label: r for label, r in each.recordings.items() if r.sizes.get("time", 0) > 1}
            for each in self.runs
        ]
        if all(len(recordings) == 1 for recordings in over_time):
            return {"": tuple(next(iter(recordings.values())) for recordings in over_time)}
        shared = [label for label in over_time[0] if all(label in f for f in over_time)]
        return {label: tuple(recordings[label] for recordings in over_time) for label in shared}

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """What the legend calls each run: its label, and what of it differs where that is short."""
        if self._mixed:
            return tuple(each.label for each in self.runs)
        differing = [s for s in self.settings if s.differs and s.name not in _NOT_NAMED]
        texts = []
        for k, each in enumerate(self.runs):
            named = [
                f"{s.name} = {value_text(s.values[k], s.unit)}"
                for s in differing
                if s.values[k] is not None
            ]
            more = len(named) - _FEW
            shown = named if more <= 0 else [*named[:_FEW], f"{more} more"]
            texts.append(f"{each.label}: {', '.join(shown)}" if shown else each.label)
        return tuple(texts)

    def _spans(self) -> list[str]:
        spans = {
            each.label: tuple(f"{duration(float(t))}" for t in recordings["time"].values[[0, -1]])
            for group in self._groups.values()
            for each, recordings in zip(self.runs, group, strict=True)
        }
        if len(set(spans.values())) < 2:
            return []
        said = ", ".join(f"{label} {low} to {high}" for label, (low, high) in spans.items())
        return [
            f"the runs cover different times ({said}): each curve ends where its run does, and "
            "key figures judge each its own"
        ]

    def _tables(self) -> tuple[list[Flat], list[Flat]]:
        """Return the blocks of settings and of key figures."""
        labels = [each.label for each in self.runs]
        blocks_of: list[list[Flat]] = []
        for title, shown, rows in (
            ("Settings", self.settings, settings_table),
            ("Key figures", self.figures, kpi_table),
        ):
            differing = [each for each in shown if each.differs]
            same = [each for each in shown if not each.differs]
            blocks: list[Flat] = []
            if differing:
                caption = f"{title} that differ."
                blocks.append(TableBlock(rows(labels, differing), caption, 0, f"{caption[:-1]}:"))
            else:
                blocks.append(Paragraph(f"{title}: all {len(same)} are the same."))
            if same and self.is_full:
                caption = f"{title} that are the same."
                blocks.append(TableBlock(rows(labels, same), caption, 0, f"{caption[:-1]}:"))
            blocks_of.append(blocks)
        return blocks_of[0], blocks_of[1]

    def _curves(self) -> list[Block]:
        from bywire.report.overlaid import can_overlay

        return [
            FigureBlock(
                partial(_drawn, dict(zip(self.labels, group, strict=True)), self._step()),
                f"All runs{f', {label}' if label else ''}: signals that they share.",
                f"overlay-{label}" if label else "overlay",
            )
            for label, group in self._groups.items()
            if can_overlay(group)
        ] or [Paragraph("The runs share no signal over time: there are no curves to compare.")]

    def _differences(self) -> list[Block]:
        """Return what each run differs from the first by, over time, where that can be drawn."""
        from bywire.report.overlaid import difference_figure

        first, *_ = self.runs
        blocks: list[Block] = []
        for label, group in self._groups.items():
            labels = [each.label for each in self.runs]
            figure = difference_figure(dict(zip(labels, group, strict=True)))
            if figure is not None:
                of = f", {label}" if label else ""
                caption = f"What the other runs differ from {first.label} by{of}."
                name = f"difference-{label}" if label else "difference"
                blocks.append(FigureBlock(figure, caption, name))
        return blocks

    def _step(self) -> tuple[str, StepLimits] | None:
        """Return signal and limits of the step that all runs are judged by, if they share it."""
        from bywire.report.step_response import step_limits

        steps = [
            None
            if each.definition is None or each.options is None
            else step_limits(each.definition, each.options, each.verdicts)
            for each in self.runs
        ]
        return steps[0] if all(each == steps[0] for each in steps) else None

    def _data(self) -> dict[str, Any]:
        def rows(shown: Sequence[Compared]) -> list[dict[str, Any]]:
            return [
                {
                    "name": s.name,
                    "unit": s.unit,
                    "values": list(s.values),
                    "differs": s.differs,
                    **({"errors": list(s.errors), "distinct": s.is_distinct} if s.errors else {}),
                }
                for s in shown
                if s.differs or self.is_full
            ]

        return {
            "runs": [
                {
                    "label": each.label,
                    "source": each.source,
                    "assembly": each.model,
                    "holds": all(v.met for v in each.verdicts),
                    "requirements": [verdict_record(verdict) for verdict in each.verdicts],
                    "changes": {
                        change.name: {"value": change.now, "instead_of": change.before}
                        for change in each.changes
                    },
                }
                for each in self.runs
            ],
            "settings": rows(self.settings),
            "kpis": rows(self.figures),
            "warnings": self.warnings,
        }


_NOT_NAMED = ("experiment", "bywire_version", "engine")


def _drawn(recordings: Mapping[str, xr.Dataset], step: tuple[str, StepLimits] | None) -> Figure:
    from bywire.report.overlaid import overlaid_panels

    return overlaid_panels(recordings, step=step)


# --- What is compared: result folders as they lie, all else run now

Comparable = Bench | Result | str | Path
Run = TypeVar("Run", bound=Comparable)


def require_comparable(runs: Sequence[Run], overrides: Mapping[str, str]) -> list[Run]:
    """Return those of some runs that are to be run yet, which changes have an effect on.

    Raises
    ------
    ParameterError
        For fewer than two runs, and changes without effect.
    """
    if len(runs) < 2:
        raise ParameterError(
            f"{len(runs)} {'run is' if len(runs) == 1 else 'runs are'} nothing to compare: name "
            "two at least, bench files, experiments or result folders"
        )
    benches = [each for each in runs if not was_run(each)]
    if overrides and not benches:
        raise ParameterError(
            f"{', '.join(overrides)} would have no effect: what is compared was run before"
        )
    return benches


def was_run(source: Comparable) -> bool:
    """Return whether something was run before."""
    return isinstance(source, Result) or is_folder(source)


def is_folder(source: Comparable) -> bool:
    """Return whether something is to be read as a result folder."""
    if not isinstance(source, str | Path):
        return False
    path = Path(source)
    if not path.is_dir():
        return False
    return is_result_folder(path) or not names_experiment(source)


def resolved(
    source: Comparable,
    overrides: Mapping[str, str],
    progress: Progress | None,
    estimate_error: bool,
) -> ComparedRun:
    """Return what a bench gives, run now unless it was."""
    if isinstance(source, Result):
        result, text = source, "given"
    elif isinstance(source, Bench):
        bench = source.with_overrides(overrides) if overrides else source
        result, text = _run(bench, progress, estimate_error), "a bench, run now"
    else:
        bench = bench_file.read(source, overrides)
        result, text = _run(bench, progress, estimate_error), f"{source}, run now"
    if result.status == "interrupted":
        raise KeyboardInterrupt
    return ran(result, result.bench.name or result.bench.experiment, text)


def _run(bench: Bench, progress: Progress | None, estimate_error: bool) -> Result:
    name = bench.name or bench.experiment
    report = None if progress is None else partial(_reported, progress, name)
    return running.run(bench, report, estimate_error=estimate_error)


def _reported(progress: Progress, name: str, label: str, share: float) -> None:
    progress(f"{name}, {label}", share)


def told_apart(runs: Sequence[ComparedRun]) -> list[ComparedRun]:
    """Return runs whose labels differ: by their sources, and else by their numbers."""
    labels = [clean(each.label) for each in runs]
    if len(set(labels)) < len(runs):
        labels = [clean(each.source) for each in runs]
    if len(set(labels)) < len(runs):
        labels = [f"{k + 1}: {clean(each.label)}" for k, each in enumerate(runs)]
    return [replace(each, label=label) for each, label in zip(runs, labels, strict=True)]
