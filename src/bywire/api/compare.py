"""Benches beside each other: what differs of settings and key figures, verdicts, curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from bywire.api.compared_run import ComparedRun, kept, ran
from bywire.api.compared_tables import (
    Compared,
    compared_figures,
    compared_settings,
    kpi_table,
    settings_table,
    verdict_table,
)
from bywire.bench import bench_file, running
from bywire.bench.bench import Bench
from bywire.bench.result import Result
from bywire.bench.result_folder import is_result_folder, verdict_record
from bywire.bench.running import Progress
from bywire.core.errors import ParameterError
from bywire.report.answer import Answer, use_case
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
from bywire.report.tables import value_text
from bywire.report.wording import clean, duration

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from bywire.report.step_marks import StepLimits

Comparable = Bench | Result | str | Path
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
            f"{each.label}: {label}" for each in self.runs for label in each.recordings
            if not any(each.recordings[label] is r for g in grouped.values() for r in g)
        ]  # fmt: skip
        if left_out:
            said.append(f"not drawn, for lack of a counterpart over time: {', '.join(left_out)}")
        said += [
            f"{each.label}: its parameter set is not known here, so its values stand without "
            "units; --system PATH loads a brake of your own"
            for each in self.runs if not each.has_units
        ]  # fmt: skip
        return said

    def document(self) -> Document:
        """Return what differs, key figures, verdicts and curves."""
        settings, figures = self._tables()
        verdicts = [TableBlock(verdict_table(self.runs), title="Requirements:")]
        verdicts = verdicts if any(each.verdicts for each in self.runs) else []
        sources = [f"{each.label}: {each.source}" for each in self.runs]
        return Document(
            "Comparison of " + ", ".join(each.label for each in self.runs),
            f"{len(self.runs)} runs; values in the order in which they were given",
            sections=lambda: [
                Section("What differs", [Listing(sources), *settings]),
                Section("Key figures", figures),
                *([Section("Requirements", verdicts)] if verdicts else []),
                Section("Curves", self._curves()),
            ],
            brief=spaced([*settings, *figures, *verdicts]),
            data=self._data(),
            record="compare.json",
        )

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
            named = [f"{s.name} = {value_text(s.values[k], s.unit)}" for s in differing
                     if s.values[k] is not None]  # fmt: skip
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
            ("Settings", self.settings, settings_table), ("Key figures", self.figures, kpi_table)
        ):  # fmt: skip
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
        from bywire.report.overlaid_panels import can_overlay

        return [
            FigureBlock(
                partial(_drawn, dict(zip(self.labels, group, strict=True)), self._step()),
                f"All runs{f', {label}' if label else ''}: signals that they share.",
                f"overlay-{label}" if label else "overlay",
            )
            for label, group in self._groups.items()
            if can_overlay(group)
        ] or [Paragraph("The runs share no signal over time: there are no curves to compare.")]

    def _step(self) -> tuple[str, StepLimits] | None:
        """Return signal and limits of the step that all runs are judged by, if they share it."""
        from bywire.report.step_marks import step_limits

        steps = [
            None if each.definition is None or each.options is None
            else step_limits(each.definition, each.options, each.verdicts)
            for each in self.runs
        ]  # fmt: skip
        return steps[0] if all(each == steps[0] for each in steps) else None

    def _data(self) -> dict[str, Any]:
        def rows(shown: Sequence[Compared]) -> list[dict[str, Any]]:
            return [
                {
                    "name": s.name, "unit": s.unit, "values": list(s.values), "differs": s.differs,
                    **({"errors": list(s.errors), "distinct": s.is_distinct} if s.errors else {}),
                }
                for s in shown if s.differs or self.is_full
            ]  # fmt: skip

        return {
            "runs": [
                {
                    "label": each.label, "source": each.source, "assembly": each.model,
                    "holds": all(v.met for v in each.verdicts),
                    "requirements": [verdict_record(verdict) for verdict in each.verdicts],
                }
                for each in self.runs
            ],
            "settings": rows(self.settings),
            "kpis": rows(self.figures),
            "warnings": self.warnings,
        }  # fmt: skip


_NOT_NAMED = ("experiment", "bywire_version", "engine")


@use_case
def compare(
    *runs: Comparable,
    overrides: Mapping[str, str] = MappingProxyType({}),
    is_full: bool = False,
    progress: Progress | None = None,
    estimate_error: bool = True,
) -> Comparison:
    """Lay benches beside each other: what differs, key figures, verdicts, curves.

    Parameters
    ----------
    runs
        Two or more, each a result folder (what ``run --out`` or `BenchResult.write` leaves), a
        `BenchResult`, or what is run now: a `Bench`, a bench file, an experiment's name. A result
        folder goes before an experiment of its name.
    overrides
        Changes of every bench that is run now, as ``--set`` takes them.
    is_full
        Whether settings and key figures that are the same are shown as well.
    progress
        Called with a label and the finished share, 0 to 1.
    estimate_error
        Whether what is run now is run in half and double steps too; see `bywire.run`. Key figures
        that differ by less than both are off, as estimated or as a folder says, are not distinct.

    Returns
    -------
    Comparison
        What differs in settings and parameters, and the key figures of all runs in SI units.

    Raises
    ------
    InputError
        For fewer than two runs, folders that are not finished or damaged, and benches that
        cannot be set up.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted: half a run compares with nothing.
    """
    if len(runs) < 2:
        raise ParameterError(
            f"{len(runs)} {'run is' if len(runs) == 1 else 'runs are'} nothing to compare: name "
            "two at least, bench files, experiments or result folders"
        )
    places = [k for k, each in enumerate(runs) if _is_folder(each)]
    if overrides and all(isinstance(each, Result) or k in places for k, each in enumerate(runs)):
        raise ParameterError(
            f"{', '.join(overrides)} would have no effect: what is compared was run before"
        )
    # Folders first: what they lack is said before anything is computed.
    read = {k: kept(Path(str(runs[k]))) for k in places}
    shown = [
        read.get(k) or _resolved(each, overrides, progress, estimate_error)
        for k, each in enumerate(runs)
    ]
    return Comparison(tuple(_told_apart(shown)), is_full)


def _is_folder(source: Comparable) -> bool:
    """Return whether something is to be read as a result folder."""
    if not isinstance(source, str | Path):
        return False
    path = Path(source)
    if not path.is_dir():
        return False
    return is_result_folder(path) or not bench_file.names_experiment(source)


def _resolved(
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


def _told_apart(runs: Sequence[ComparedRun]) -> list[ComparedRun]:
    """Return runs whose labels differ: by their sources, and else by their numbers."""
    labels = [clean(each.label) for each in runs]
    if len(set(labels)) < len(runs):
        labels = [clean(each.source) for each in runs]
    if len(set(labels)) < len(runs):
        labels = [f"{k + 1}: {clean(each.label)}" for k, each in enumerate(runs)]
    return [replace(each, label=label) for each, label in zip(runs, labels, strict=True)]


def _drawn(recordings: Mapping[str, xr.Dataset], step: tuple[str, StepLimits] | None) -> Figure:
    from bywire.report.overlaid_panels import overlaid_panels

    return overlaid_panels(recordings, step=step)
