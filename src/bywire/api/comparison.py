"""Comparison of runs: settings and key figures that differ, verdicts, and curves."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from bywire.api.run import bench_of
from bywire.bench import running
from bywire.bench.bench import Bench
from bywire.bench.bench_file import flattened, names_experiment
from bywire.bench.changes import OPTION
from bywire.bench.experiment import Experiment
from bywire.bench.generic_experiment import experiment_of
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Verdict
from bywire.bench.result_folder import is_result_folder, read_result, verdict_record
from bywire.bench.running import Result
from bywire.bench.step_choice import with_chosen_step
from bywire.bench.step_error import are_distinct
from bywire.bench.stimulus import STIMULI
from bywire.core.callers import is_command_line
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import InputError, ParameterError
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.typing import Progress
from bywire.core.units import difference_unit
from bywire.report.answer import Answer
from bywire.report.document import (
    Banner,
    Block,
    Change,
    Document,
    FigureBlock,
    Flat,
    Listing,
    Paragraph,
    Section,
    TableBlock,
    spaced,
)
from bywire.report.subject import bench_changes
from bywire.report.tables import Cell, Column, Table, measured_cell, value_text
from bywire.report.terminal import change_texts
from bywire.report.wording import amount, beside_limit, clean, measured_amount

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from bywire.report.step_response import StepLimits

_BENCH = {
    "experiment": "experiment",
    "parameter_set": "parameters",
    "model": "assembly",
    "step": "simulation.step",
    "seed": "simulation.seed",
}
"""attributes of a recording that bench files set, with their names in these files"""
_PROGRAM = ("bywire_version", "engine")


@dataclass(frozen=True)
class Setting:
    """Setting of a bench: a value in its SI unit, or a choice."""

    value: Any
    unit: str = "1"


@dataclass(frozen=True)
class ComparedRun:
    """Run of a bench, ready for comparison.

    Parameters
    ----------
    label
        Name in the comparison.
    source
        Origin: a folder, a bench file or an experiment.
    recordings
        One dataset for each run of the experiment, by label.
    kpis, verdicts
        Key figures, and verdicts on requirements.
    warnings
        Warnings of the run.
    changes
        Changes from the published values.
    """

    label: str
    source: str
    recordings: Mapping[str, xr.Dataset]
    kpis: tuple[Kpi, ...]
    verdicts: tuple[Verdict, ...]
    warnings: tuple[str, ...] = ()
    changes: tuple[Change, ...] = ()

    @cached_property
    def attributes(self) -> Mapping[str, Any]:
        """Attributes of the first recording as plain numbers and texts."""
        attributes = next(iter(self.recordings.values())).attrs
        return {key: v.item() if isinstance(v, np.generic) else v for key, v in attributes.items()}

    @property
    def model(self) -> str:
        """Name of the assembly under test."""
        return str(self.attributes.get("model", ""))

    @cached_property
    def definition(self) -> Experiment | None:
        """The experiment, or None if it is not installed."""
        attributes = self.attributes
        name, cited, model = (
            str(attributes.get(k, "")) for k in ("experiment", "parameter_set", "model")
        )
        with contextlib.suppress(InputError):
            return experiment_of(name, cited, model, flattened(_object(attributes, "options")))
        return None

    @cached_property
    def options(self) -> Any:
        """The experiment's options, or None if they cannot be read."""
        if self.definition is None:
            return None
        with contextlib.suppress(InputError):
            return self.definition.options.create(_tupled(_object(self.attributes, "options")))
        return None

    @cached_property
    def settings(self) -> dict[str, Setting]:
        """All settings by the names that ``--set`` accepts."""
        attributes = self.attributes
        settings = {
            name: Setting(attributes[key], "s" if key == "step" else "1")
            for key, name in _BENCH.items()
            if key in attributes
        }
        options = None if self.definition is None else self.definition.options
        settings |= dict(_settings(_object(attributes, "options"), options, OPTION))
        settings |= dict(self._stimuli())
        settings |= dict(_settings(_object(attributes, "parameters"), self._parameter_class))
        return settings | {key: Setting(attributes[key]) for key in _PROGRAM if key in attributes}

    @property
    def has_units(self) -> bool:
        """Whether its parameter set is installed, so that the units are known."""
        return self._parameter_class is not None

    @property
    def _parameter_class(self) -> type[ParameterSet] | None:
        name = str(self.attributes.get("parameter_set", ""))
        cited = PARAMETER_SETS.all().get(name)
        return None if cited is None else cited.parameter_class

    def _stimuli(self) -> Iterator[tuple[str, Setting]]:
        """Yield the settings of ``[stimulus]`` and its subsections."""
        sections = _object(self.attributes, "stimulus")
        further = {name: each for name, each in sections.items() if isinstance(each, Mapping)}
        plain = {name: each for name, each in sections.items() if name not in further}
        units: dict[str, str] = {}
        if self.definition is not None and self.options is not None:
            known = self.definition
            units = dict(known.beside(self.options)) if known.beside is not None else {}
            if known.driven_unit is not None:
                units[""] = known.driven_unit(self.options)
        for signal, section in {"": plain, **further}.items():
            kind = STIMULI.all().get(str(section.get("kind", "")))
            prefix = f"stimulus.{signal}." if signal else "stimulus."
            cls = None if kind is None else kind.parameter_class
            yield from _settings(section, cls, prefix, units.get(signal, "1"))


def ran(result: Result, label: str, source: str) -> ComparedRun:
    """Return a run that this call computed."""
    warned = tuple(result.warnings)
    return ComparedRun(
        label,
        source,
        result.recordings,
        result.kpis,
        result.verdicts,
        warned,
        bench_changes(result.bench),
    )


def kept(folder: Path) -> ComparedRun:
    """Read a run from a result folder.

    Raises
    ------
    FileError
        See `read_result`.
    """
    result = read_result(folder)
    name = folder.resolve().name
    changes = tuple(
        Change(changed, each["value"], each["instead_of"], each["of"])
        for changed, each in result.changes.items()
    )
    return ComparedRun(
        name, str(folder), result.recordings, result.kpis, result.verdicts, result.warnings, changes
    )


def _settings(
    values: Mapping[str, Any], cls: type[ParameterSet] | None, prefix: str = "", level: str = "1"
) -> Iterator[tuple[str, Setting]]:
    leaves = {} if cls is None else leaf_fields(cls)
    for name, value in _tupled(values).items():
        unit = leaves[name].unit.symbol if name in leaves else "1"
        yield f"{prefix}{name}", Setting(value, unit.replace("level", level))


def _tupled(values: Mapping[str, Any]) -> dict[str, Any]:
    flat = flattened(values)
    return {name: tuple(v) if isinstance(v, list) else v for name, v in flat.items()}


def _object(attributes: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Return an attribute's JSON object, or an empty object."""
    with contextlib.suppress(ValueError):
        content = json.loads(str(attributes.get(key, "{}")))
        return content if isinstance(content, dict) else {}
    return {}


# --- Settings, key figures and verdicts side by side

_LONGEST = 48  # characters of a value in a table


@dataclass(frozen=True)
class Compared:
    """Setting or key figure, with its values in all runs.

    Parameters
    ----------
    name, unit
        Name, and SI unit or ``"%"``.
    values
        Value in each run: None if a run does not have it, NaN if it is undefined.
    errors
        Numerical error of a key figure in each run, NaN if it was not estimated.
    """

    name: str
    unit: str
    values: tuple[Any, ...]
    errors: tuple[float, ...] = ()

    @property
    def differs(self) -> bool:
        """Whether the runs have different values. Undefined values are treated as equal."""
        first, *others = (_comparable(value) for value in self.values)
        return any(value != first for value in others)

    @property
    def largest(self) -> float:
        """Maximum magnitude of a key figure, which determines the unit of all its values."""
        known = (abs(v) for v in self.values if v is not None and math.isfinite(v))
        return max(known, default=0.0)

    @property
    def ratio(self) -> float:
        """Spread of a key figure relative to its smallest magnitude. 0 if a value is 0."""
        known = [v for v in self.values if v is not None and math.isfinite(v)]
        least = min(map(abs, known), default=0.0)
        return (max(known) - min(known)) / least if least and len(known) > 1 else 0.0

    @property
    def is_distinct(self) -> bool:
        """Whether a key figure differs by more than its errors, assumed independent."""
        values = [math.nan if value is None else value for value in self.values]
        return are_distinct(values, self.errors)


def _compared_settings(runs: Sequence[ComparedRun], *, shared_only: bool) -> tuple[Compared, ...]:
    """Return all settings, or only those that all runs share."""
    names = list(dict.fromkeys(name for each in runs for name in each.settings))
    if shared_only:
        names = [name for name in names if all(name in each.settings for each in runs)]
    rows = []
    for name in names:
        present = [each.settings.get(name) for each in runs]
        unit = next(each.unit for each in present if each is not None)
        rows.append(Compared(name, unit, tuple(_value(each) for each in present)))
    return tuple(rows)


def _compared_figures(runs: Sequence[ComparedRun]) -> tuple[Compared, ...]:
    """Return the key figures of all runs. Figures with different units are separate."""
    keys = dict.fromkeys((kpi.name, kpi.unit) for each in runs for kpi in each.kpis)
    each_run = [{(k.name, k.unit): (k.value, k.bound) for k in each.kpis} for each in runs]
    rows = []
    for name, unit in keys:
        pairs = [known.get((name, unit), (None, math.nan)) for known in each_run]
        rows.append(Compared(name, unit, tuple(v for v, _ in pairs), tuple(e for _, e in pairs)))
    return tuple(rows)


def _settings_table(labels: Sequence[str], rows: Sequence[Compared]) -> Table:
    """Return a table of settings with one column for each run."""
    return Table(
        (Column("setting"), *(Column(label, numeric=True) for label in labels)),
        tuple(
            (Cell(clean(each.name)), *(_setting(v, each.unit) for v in each.values))
            for each in rows
        ),
    )


def _kpi_table(labels: Sequence[str], rows: Sequence[Compared]) -> Table:
    """Return a table of key figures with a column for each run, and one for change or spread."""
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
                    measured_cell(v, each.unit, e, like=each.largest)
                    for v, e in zip(each.values, each.errors, strict=True)
                ),
                _change(each),
            )
            for each in rows
        ),
    )


def _verdict_table(runs: Sequence[ComparedRun]) -> Table:
    """Return a table with one requirement per row and the verdict of each run."""
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
            value, error, unit = beside_limit(verdict.value, verdict.error, verdict.unit, limit)
            shown = measured_amount(value, unit, error)
            text = f"{shown} {verdict.outcome}"
            cells.append(Cell(text, "good" if verdict.met else "bad", verdict.outcome))
        rows.append((Cell(clean(name)), Cell(clean(limit)), *cells))
    columns = (Column("requirement"), Column("limit", numeric=True))
    return Table((*columns, *(Column(each.label, numeric=True) for each in runs)), tuple(rows))


def _not_met(run: ComparedRun) -> list[Verdict]:
    return [verdict for verdict in run.verdicts if verdict.outcome != "met"]


def _change(row: Compared) -> Cell:
    """Return the difference between two values or the spread of several, if it is distinct."""
    known = [value for value in row.values if value is not None and math.isfinite(value)]
    if len(known) < len(row.values):
        return Cell("-")
    is_pair = len(known) == 2
    low, high = (0, 1) if is_pair else (known.index(min(known)), known.index(max(known)))
    first, change = known[low], known[high] - known[low]
    if not row.is_distinct:
        return Cell("not distinct", value=change)
    error = row.errors[low] + row.errors[high]
    of = difference_unit(row.unit)
    written = measured_amount(change, of, error, 3, like=row.largest if of == row.unit else None)
    is_share = is_pair and first and row.unit not in ("%", "K")
    sign = "+" if is_pair and change > 0 else ""
    share = f" ({sign}{amount(100 * change / abs(first), '%', 3)})" if is_share else ""
    return Cell(f"{sign}{written}{share}", value=change)


def _setting(value: Any, unit: str) -> Cell:
    text = value_text(value, unit)
    return Cell(text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…", value=value)


def _value(setting: Setting | None) -> Any:
    return None if setting is None else setting.value


def _comparable(value: Any) -> Any:
    """Return a value that equals itself even if it is NaN."""
    return "NaN" if isinstance(value, float) and math.isnan(value) else value


# --- The comparison

_FEW = 2  # differing settings in a legend


@dataclass(frozen=True)
class Comparison(Answer):
    """Comparison of several runs.

    Parameters
    ----------
    runs
        Runs to compare.
    is_full
        Whether to also show identical settings and key figures.
    """

    runs: tuple[ComparedRun, ...]
    is_full: bool = False

    @cached_property
    def settings(self) -> tuple[Compared, ...]:
        """All settings. For different brakes, only those that all runs share."""
        return _compared_settings(self.runs, shared_only=self._mixed)

    @cached_property
    def figures(self) -> tuple[Compared, ...]:
        """Key figures of all runs. Figures with one name and different units are separate."""
        return _compared_figures(self.runs)

    @property
    def warnings(self) -> list[str]:
        """Limitations of the comparison, and warnings of the runs."""
        texts = [f"{each.label}: {text}" for each in self.runs for text in each.warnings]
        if self._mixed:
            names = ", ".join(f"{each.label} is a {each.model}" for each in self.runs)
            texts.append(
                f"the runs use different brakes ({names}). bywire compares only the parameters and "
                "signals that they share"
            )
        texts += self._spans()
        grouped = self._groups
        left_out = [
            f"{each.label}: {label}"
            for each in self.runs
            for label in each.recordings
            if not any(each.recordings[label] is r for g in grouped.values() for r in g)
        ]
        if left_out:
            texts.append(f"recordings that only one run has are not drawn: {', '.join(left_out)}")
        texts += [
            f"{each.label}: its parameter set is not loaded, so its values have no units. Load "
            f"your brake with {'--system PATH' if is_command_line() else 'bywire.load_system'}"
            for each in self.runs
            if not each.has_units
        ]
        return texts

    def document(self) -> Document:
        """Return the differences, key figures, verdicts and curves."""
        settings, figures = self._tables()
        verdicts = [TableBlock(_verdict_table(self.runs), title="Requirements:")]
        verdicts = verdicts if any(each.verdicts for each in self.runs) else []
        sources = [f"{each.label}: {each.source}" for each in self.runs]
        changed = self._changed()
        changes = [Listing(changed, "Also changed:")] if changed else []
        conclusion = self._conclusion()
        return Document(
            "Comparison of " + ", ".join(each.label for each in self.runs),
            f"{len(self.runs)} runs, with values in the order of the command",
            sections=lambda: [
                *([Section("Requirements", verdicts)] if verdicts else []),
                Section("Differing settings", [Listing(sources), *settings, *changes]),
                Section("Curves", self._curves()),
                *([Section("Differences", apart)] if (apart := self._differences()) else []),
                Section("Key figures", figures),
            ],
            brief=spaced([f"{conclusion}.", *verdicts, *settings, *figures, *changes]),
            data=self._data(),
            banner=Banner(conclusion, self._overall()),
            record="compare.json",
        )

    def _conclusion(self) -> str:
        """Return which runs meet the requirements, worst first, and what differs most."""
        parts = []
        judged = [each for each in self.runs if each.verdicts]
        for each in sorted(judged, key=lambda run: -len(_not_met(run))):
            open_ = [f"{v.kpi} {v.outcome}" for v in _not_met(each)]
            met = f"{len(each.verdicts) - len(open_)} of {len(each.verdicts)} requirements"
            missed = f" ({', '.join(open_)})" if open_ else ""
            parts.append(f"{each.label} meets {met}{missed}")
        unjudged = [each.label for each in self.runs if not each.verdicts] if judged else []
        parts += [f"{label} has no requirements" for label in unjudged]
        distinct = [each for each in self.figures if each.differs and each.is_distinct]
        count = f"{len(distinct)} of {len(self.figures)} key figures differ"
        most = max(distinct, key=lambda each: each.ratio, default=None)
        if most is not None and math.isfinite(most.ratio) and most.ratio > 0.0:
            pairs = zip(most.values, most.errors, strict=True)
            values = (measured_amount(v, most.unit, e, like=most.largest) for v, e in pairs)
            count += f", {most.name} the most ({', '.join(values)})"
        return "; ".join([*parts, count])

    def _overall(self) -> Literal["good", "bad", "open", "none"]:
        outcomes = {v.outcome for each in self.runs for v in each.verdicts}
        if "missed" in outcomes:
            return "bad"
        if "undecided" in outcomes:
            return "open"
        return "good" if all(each.verdicts for each in self.runs) else "none"

    def _changed(self) -> list[str]:
        """Return the changes of the runs, except settings that differ between the runs."""
        differing = {each.name for each in self.settings if each.differs}
        runs_by_text: dict[str, list[str]] = {}
        for each in self.runs:
            for text in change_texts([c for c in each.changes if c.name not in differing]):
                runs_by_text.setdefault(text, []).append(each.label)
        every = len(self.runs)
        return [
            text if len(labels) == every else f"{', '.join(labels)}: {text}"
            for text, labels in runs_by_text.items()
        ]

    @property
    def _mixed(self) -> bool:
        return len({each.model for each in self.runs}) > 1

    @cached_property
    def _groups(self) -> dict[str, tuple[xr.Dataset, ...]]:
        """Recordings over time that correspond to each other, by label or as the only one."""
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
        """Legend entries: each run's label, with its differing settings if there are few."""
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
            each.label: tuple(amount(float(t), "s") for t in recordings["time"].values[[0, -1]])
            for group in self._groups.values()
            for each, recordings in zip(self.runs, group, strict=True)
        }
        if len(set(spans.values())) < 2:
            return []
        times = ", ".join(f"{label} {low} to {high}" for label, (low, high) in spans.items())
        return [
            f"the runs cover different times ({times}). Each curve ends with its run, and each "
            f"key figure covers only the time of its run"
        ]

    def _tables(self) -> tuple[list[Flat], list[Flat]]:
        """Return the tables of settings and of key figures."""
        labels = [each.label for each in self.runs]
        blocks_of: list[list[Flat]] = []
        for title, shown, rows in (
            ("Settings", self.settings, _settings_table),
            ("Key figures", self.figures, _kpi_table),
        ):
            differing = [each for each in shown if each.differs]
            same = [each for each in shown if not each.differs]
            blocks: list[Flat] = []
            if differing:
                caption = f"{title} that differ."
                blocks.append(TableBlock(rows(labels, differing), caption, f"{caption[:-1]}:"))
            else:
                blocks.append(Paragraph(f"{title}: all {len(same)} are equal."))
            if same and self.is_full:
                caption = f"{title} that are equal."
                blocks.append(TableBlock(rows(labels, same), caption, f"{caption[:-1]}:"))
            blocks_of.append(blocks)
        return blocks_of[0], blocks_of[1]

    def _curves(self) -> list[Block]:
        from bywire.report.time_traces import can_overlay

        return [
            FigureBlock(
                partial(_drawn, dict(zip(self.labels, group, strict=True)), self._step()),
                f"Signals that all runs share{f', {label}' if label else ''}.",
                f"overlay-{label}" if label else "overlay",
            )
            for label, group in self._groups.items()
            if can_overlay(group)
        ] or [Paragraph("The runs share no signals over time, so there are no curves to compare.")]

    def _differences(self) -> list[Block]:
        """Return figures of each run's difference from the first run over time, where possible."""
        from bywire.report.time_traces import difference_figure

        first, *_ = self.runs
        blocks: list[Block] = []
        for label, group in self._groups.items():
            labels = [each.label for each in self.runs]
            figure = difference_figure(dict(zip(labels, group, strict=True)))
            if figure is not None:
                of = f", {label}" if label else ""
                caption = f"Other runs minus {first.label}{of}."
                name = f"difference-{label}" if label else "difference"
                blocks.append(FigureBlock(figure, caption, name))
        return blocks

    def _step(self) -> tuple[str, StepLimits] | None:
        """Return the signal and limits of the step by which all runs are judged, if shared."""
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
    from bywire.report.time_traces import overlaid_panels

    return overlaid_panels(recordings, step=step)


# --- Runs to compare: read from result folders, or computed

Comparable = Bench | Result | str | Path
Run = TypeVar("Run", bound=Comparable)


def compared(
    runs: Sequence[Comparable],
    overrides: Mapping[str, str],
    is_full: bool,
    progress: Progress | None,
    estimate_error: bool,
) -> Comparison:
    """Compare runs (see `bywire.compare`)."""
    require_comparable(runs, overrides)
    # Folders first, so that an incomplete one raises an error before the computation.
    read = {k: kept(Path(str(each))) for k, each in enumerate(runs) if _is_folder(each)}
    shown = [
        read.get(k) or _resolved(each, overrides, progress, estimate_error)
        for k, each in enumerate(runs)
    ]
    return Comparison(tuple(_told_apart(shown)), is_full)


def require_comparable(runs: Sequence[Run], overrides: Mapping[str, str]) -> list[Run]:
    """Return the runs that must still be computed, which changes can affect.

    Raises
    ------
    ParameterError
        If there are fewer than two runs, or changes would have no effect.
    """
    if len(runs) < 2:
        raise ParameterError(
            f"a comparison needs at least two runs, not {len(runs)}. Specify bench files, "
            "experiments or result folders",
            name="runs",
            value=str(len(runs)),
            valid="at least two",
        )
    benches = [each for each in runs if not _was_run(each)]
    if overrides and not benches:
        raise ParameterError(
            f"{', '.join(overrides)} would have no effect, because all runs are already computed. "
            "Remove the changes, or compare bench files",
            name=", ".join(overrides),
        )
    return benches


def _was_run(source: Comparable) -> bool:
    """Return whether a run is already computed."""
    return isinstance(source, Result) or _is_folder(source)


def _is_folder(source: Comparable) -> bool:
    """Return whether a source is a result folder."""
    if not isinstance(source, str | Path):
        return False
    path = Path(source)
    if not path.is_dir():
        return False
    return is_result_folder(path) or not names_experiment(source)


def _resolved(
    source: Comparable,
    overrides: Mapping[str, str],
    progress: Progress | None,
    estimate_error: bool,
) -> ComparedRun:
    """Return a run, computed now unless it already was."""
    if isinstance(source, Result):
        result, text = source, "given"
    else:
        result = _run(bench_of(source, overrides), progress, estimate_error)
        text = f"{'a bench' if isinstance(source, Bench) else source}, run now"
    if result.status == "interrupted":
        raise KeyboardInterrupt
    return ran(result, result.bench.name or result.bench.experiment, text)


def _run(bench: Bench, progress: Progress | None, estimate_error: bool) -> Result:
    name = bench.name or bench.experiment
    report = None if progress is None else partial(_reported, progress, name)
    bench = with_chosen_step(bench, progress=report)
    return running.run(bench, report, estimate_error=estimate_error)


def _reported(progress: Progress, name: str, label: str, share: float) -> None:
    progress(f"{name}, {label}", share)


def _told_apart(runs: Sequence[ComparedRun]) -> list[ComparedRun]:
    """Return runs with unique labels: names if they differ, otherwise sources or numbers."""
    labels = [clean(each.label) for each in runs]
    if len(set(labels)) < len(runs):
        labels = [clean(each.source) for each in runs]
    if len(set(labels)) < len(runs):
        labels = [f"{k + 1}: {clean(each.label)}" for k, each in enumerate(runs)]
    return [replace(each, label=label) for each, label in zip(runs, labels, strict=True)]
