"""Sections of a run's report: the outcome first, then books of energy and how it was made."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.energy_ledger import Ledger
from bywire.bench.result import Result
from bywire.bench.stated import stated_for
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.model import ASSEMBLIES
from bywire.core.units import difference_unit
from bywire.report.document import Block, Details, Paragraph, Section, TableBlock
from bywire.report.schematic import schematic_blocks
from bywire.report.stated_levels import stated_level
from bywire.report.subject import Subject, parameter_rows
from bywire.report.tables import (
    Cell,
    KpiRow,
    Table,
    amount_cell,
    kpi_table,
    parameter_table,
    text_table,
)

RECORDED = ("bywire_version", "parameter_hash", "step", "engine", "status", "seed")
"""attributes of a recording that say how it was made"""


def outcome(result: Result, rows: Sequence[KpiRow], notes: Sequence[Block]) -> Section:
    """Return what was required, what was changed, and what else to know before looking on.

    ``rows``: key figures beside their requirements; ``notes``: warnings and remarks.
    """
    blocks: list[Block] = []
    if judged := [row for row in rows if row.limit]:
        blocks.append(TableBlock(kpi_table(judged), "What was required."))
    return Section("Outcome", [*blocks, Subject.of_bench(result.bench).changes_block, *notes])


def options_in_use(bench: Bench) -> Details:
    """Return all options of a bench's experiment, folded."""
    table = parameter_table(parameter_rows(bench.chosen_options))
    return Details("Options of the experiment", [TableBlock(table)])


def source_says(result: Result) -> list[Block]:
    """Return what a source states for the experiment, drawn in green in its figures."""
    levels = stated_for(result.bench)
    if not levels:
        return []
    units = {
        name: str(signal.attrs.get("units", "1"))
        for recording in result.recordings.values()
        for name, signal in recording.data_vars.items()
    }
    rows = [
        (each.label, each.signal, stated_level(each, units.get(each.signal, "1")), each.where)
        for each in levels
    ]
    table = text_table(("level", "signal", "stated", "where"), rows)
    return [TableBlock(table, "What the source states for this experiment: green in the figures.")]


def energy(ledgers: Mapping[str, Ledger]) -> list[Section]:
    """Return the books of every run that keeps any, by label."""
    blocks: list[Block] = []
    for label, books in ledgers.items():
        blocks += [Paragraph(f"{label}, from time zero on:"), TableBlock(energy_table(books))]
    return [Section("Energy", blocks)] if blocks else []


def schematic_section(bench: Bench) -> list[Section]:
    """Return the brake as parts and wires, where its model is made of such."""
    case = next(iter(replace(bench, faults=()).cases()), None)  # without what bends its signals
    model, par = (
        (ASSEMBLIES.find(bench.system)(), bench.par) if case is None else (case.model, case.par)
    )
    blocks = schematic_blocks(model, par)
    return [Section("Schematic", blocks)] if blocks else []


def how_it_was_made(
    result: Result, errors: Mapping[str, Mapping[str, Mapping[str, Any]]]
) -> Section:
    """Return source, program and all values.

    ``errors``: of every recorded signal from the step, by run and name.
    """
    bench, cited = result.bench, PARAMETER_SETS.find(result.bench.parameters)
    attrs = next(iter(result.recordings.values())).attrs if result.recordings else {}
    kept = "; ".join(f"{key} {attrs[key]}" for key in RECORDED if key in attrs)
    parameters = parameter_table(parameter_rows(bench.par, cited.values))
    return Section(
        "How it was made",
        [
            Paragraph(f"Source of the parameters: {cited.source}."),
            Paragraph(f"{kept}."),
            *_signal_errors(errors),
            options_in_use(bench),
            Details("All parameters", [TableBlock(parameters)]),
        ],
    )


def energy_table(books: Ledger) -> Table:
    """Return a ledger as a table: place, energy, share of what was turned over."""
    total = books.turnover

    def row(side: str, label: str, energy: float) -> tuple[str | Cell, ...]:
        share = 100.0 * energy / total if total > 0 else math.nan
        text = f"{share:.3g} %" if total > 0 else "-"
        return side, label, amount_cell(energy, "J"), Cell(text, value=share, unit="%")

    rows = [row("from", posting.label, posting.energy) for posting in books.sources]
    rows += [row("to", posting.label, posting.energy) for posting in books.sinks]
    rows.append(row("", "closing error", books.closing_error))
    return text_table(["", "place", "energy", "share of what was given"], rows)


def _signal_errors(errors: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> list[Details]:
    """Return how far each recorded signal is off, where that was estimated."""
    rows = [
        (label, name, amount_cell(error["rms"], unit, 2), amount_cell(error["max"], unit, 2))
        for label, signals in errors.items()
        for name, error in signals.items()
        for unit in (difference_unit(error["unit"]),)
    ]
    if not rows:
        return []
    table = text_table(["run", "signal", "rms", "largest"], rows)
    return [Details("Error of recorded signals from the step", [TableBlock(table)])]
