"""Benches beside each other: what differs of settings and key figures, verdicts, curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from bywire.api.compared_run import ComparedRun
from bywire.api.compared_tables import (
    Compared,
    compared_figures,
    compared_settings,
    kpi_table,
    settings_table,
    verdict_table,
)
from bywire.bench.result_folder import verdict_record
from bywire.core.callers import is_command_line
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
from bywire.report.tables import value_text
from bywire.report.terminal import change_texts
from bywire.report.wording import duration

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from bywire.report.step_response import StepLimits

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
