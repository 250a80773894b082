"""Parts of reports on runs and studies: remarks, sections, and the tested bench."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.energy_ledger import Ledger
from bywire.bench.experiment import Recordings, error_text
from bywire.bench.kpis.families import FAMILIES
from bywire.bench.running import Result
from bywire.bench.stated import stated_for
from bywire.bench.step_choice import percent_text
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.model import ASSEMBLIES
from bywire.core.units import difference_unit, shown
from bywire.report.document import Block, Details, Listing, Paragraph, Section, TableBlock
from bywire.report.schematic import schematic_blocks
from bywire.report.stated_levels import stated_level
from bywire.report.subject import (
    Subject,
    bench_changes,
    origins_block,
    parameter_rows,
    source_block,
)
from bywire.report.tables import (
    Cell,
    KpiRow,
    Table,
    amount_cell,
    kpi_table,
    parameter_table,
    text_table,
)
from bywire.report.wording import amount, clean, part_text
from bywire.studies.plan import StudiedBench, StudyPlan, Varied

_MOST = {"share_stuck": 0.5, "share_sat_current": 0.1, "share_sat_duty": 0.1}
_MISSED = 0.05  # of the step's height


def remarks(result: Result) -> list[str]:
    """Return remarks on unexpected behavior of a run.

    A run gets a remark if it sticks for more than half of its time, is at a limit for more than a
    tenth, or misses its set point by more than a twentieth of the step. Faults and the model's own
    remarks are included.
    """
    faults = fault_texts(result.bench, result.recorded)
    return [
        *choice_texts(result.bench),
        *faults,
        *_shares(result),
        *_set_point(result),
        *_of_models(result),
    ]


def choice_texts(bench: Bench) -> list[str]:
    """Return a sentence about the step that bywire chose for a stated error, if it chose one."""
    choice = bench.choice
    if choice is None:
        return []
    of = f" of this bench and {choice.benches - 1} of its cases" * (choice.benches > 1)
    reached = percent_text(choice.reached)
    return [
        f"step {shown(choice.step, 's', 'us')}, chosen for simulation.error = "
        f"{error_text(choice.stated)} (maximum estimated error{of}: {reached}, {choice.figure})"
    ]


def choice_data(bench: Bench) -> dict[str, Any]:
    """Return the step that bywire chose for a stated error as JSON; empty if it chose none."""
    choice = bench.choice
    if choice is None:
        return {}
    about = {
        "stated_error": choice.stated,
        "estimated_error": choice.reached,
        "figure": choice.figure,
        "benches": choice.benches,
    }
    return {"step": {"value": choice.step, "unit": "s", **about}}


def fault_texts(bench: Bench, recordings: Recordings | None = None) -> list[str]:
    """Return a sentence about each fault of a bench, with size, time and description.

    ``recordings`` are the bench's runs, to report a fault that no run reaches. None skips this.
    """
    texts = []
    for fault in bench.injections:
        mode, course = fault.mode, fault.course
        size = f" = {amount(fault.value, mode.unit)}" if mode.unit else ""
        until = f" to {amount(course.end, 's')}" if math.isfinite(course.end) else " on"
        is_met = recordings is None or any(
            course.is_there(each["time"].values).any()
            for each in recordings.values()
            if "time" in each
        )
        unmet = "" if is_met else "; not active in any recorded sample"
        texts.append(
            f"fault {mode.name}{size}, from {amount(course.onset, 's')}{until}: "
            f"{mode.summary}{unmet}"
        )
    return texts


def _of_models(result: Result) -> list[str]:
    """Return remarks of the models on their runs, without repetitions.

    Recordings without all signals of the model are skipped.
    """
    texts: dict[str, None] = {}
    models = ASSEMBLIES.beside(type(result.bench.par))
    for recording in result.recorded.values():
        model = models.get(str(recording.attrs.get("model")))
        text = recording.attrs.get("parameters")
        if model is None or text is None or not recording.sizes.get("time"):
            continue
        if all(name in recording for name in model.Output._fields):
            par = type(result.bench.par).model_validate_json(text)
            texts |= dict.fromkeys(model().remarks(recording, par))
    return list(texts)


def _shares(result: Result) -> list[str]:
    measures = FAMILIES.find("occupation").measures
    texts = []
    for kpi in result.kpis:
        name = next((each for each in measures if kpi.name.startswith(each)), "")
        if name and kpi.value > _MOST[name]:  # NaN is not
            what = measures[name].definition.rpartition(" which ")[2].rstrip(".")
            where = kpi.name.removeprefix(name).strip("_")
            texts.append(f"{what} {100 * kpi.value:.3g} % of the time{where and f' ({where})'}")
    return texts


def _set_point(result: Result) -> list[str]:
    definition, kpis = result.bench.definition, {kpi.name: kpi for kpi in result.kpis}
    error = kpis.get("steady_state_error")
    if definition.step is None or error is None or math.isnan(error.value):
        return []
    step = definition.step(result.bench.chosen_options)
    if step.start is None or step.end is None or step.start == step.end:
        return []
    share = error.value / abs(step.end - step.start)
    if not share > _MISSED:
        return []
    return [
        f"misses its set point: {step.signal} ends {amount(error.value, error.unit)} away from "
        f"{amount(step.end, error.unit)} ({100 * share:.3g} % of the step)"
    ]


# --- Sections

_RECORDED = ("bywire_version", "parameter_hash", "step", "engine", "status", "seed")
"""attributes of a recording with the settings of its run"""


def outcome(result: Result, rows: Sequence[KpiRow], notes: Sequence[Block]) -> Section:
    """Return requirements, changes and notes, the first section of a report.

    ``rows`` are key figures with their requirements. ``notes`` are warnings and remarks.
    """
    blocks: list[Block] = []
    if judged := [row for row in rows if row.limit]:
        blocks.append(TableBlock(kpi_table(judged), "Requirements"))
    changed = Subject.of_bench(result.bench).changes_block
    return Section("Outcome", [*blocks, changed, *notes, origins_block(result.bench.parameters)])


def _options_in_use(bench: Bench) -> Details:
    """Return all options of a bench's experiment, collapsed."""
    table = parameter_table(parameter_rows(bench.chosen_options))
    return Details("Experiment options", [TableBlock(table)])


def source_says(result: Result) -> list[Block]:
    """Return the published values for the experiment, drawn in green in its figures."""
    levels = stated_for(result.bench)
    if not levels:
        return []
    units = {
        name: str(signal.attrs.get("units", "1"))
        for recording in result.recorded.values()
        for name, signal in recording.data_vars.items()
    }
    rows = [
        (each.label, each.signal, stated_level(each, units.get(each.signal, "1")), each.where)
        for each in levels
    ]
    table = text_table(("level", "signal", "stated", "where"), rows)
    return [TableBlock(table, "Published values for this experiment, drawn in green.")]


def energy(ledgers: Mapping[str, Ledger]) -> list[Section]:
    """Return the energy balances of all runs that have one, by label."""
    blocks: list[Block] = []
    for label, books in ledgers.items():
        blocks += [Paragraph(f"{label}, from time zero on:"), TableBlock(energy_table(books))]
    return [Section("Energy", blocks)] if blocks else []


def schematic_section(bench: Bench) -> list[Section]:
    """Return the brake's parts and wires, if its model consists of them."""
    case = next(iter(replace(bench, faults=()).cases()), None)  # without faults of signals
    model, par = (
        (ASSEMBLIES.find(bench.system)(), bench.par) if case is None else (case.model, case.par)
    )
    blocks = schematic_blocks(model, par)
    return [Section("Schematic", blocks)] if blocks else []


def how_it_was_made(
    result: Result, errors: Mapping[str, Mapping[str, Mapping[str, Any]]]
) -> Section:
    """Return source, program and all values.

    ``errors`` are the numerical errors of all recorded signals, by run and name.
    """
    bench, cited = result.bench, PARAMETER_SETS.find(result.bench.parameters)
    attrs = next(iter(result.recorded.values())).attrs if result.recorded else {}
    kept = "; ".join(f"{key} {attrs[key]}" for key in _RECORDED if key in attrs)
    parameters = parameter_table(parameter_rows(bench.par, cited.values))
    return Section(
        "Settings",
        [
            source_block(bench.parameters),
            Paragraph(f"{kept}."),
            *_signal_errors(errors),
            _options_in_use(bench),
            Details("All parameters", [TableBlock(parameters)]),
        ],
    )


def energy_table(books: Ledger) -> Table:
    """Return an energy balance as a table: place, energy, fraction of the supplied energy."""
    total = books.turnover

    def row(side: str, label: str, energy: float) -> tuple[str | Cell, ...]:
        share = 100.0 * energy / total if total > 0 else math.nan
        text = part_text(share, "%", 100.0) if total > 0 else "-"
        size = part_text(energy, "J", total)
        return side, label, Cell(size, value=energy, unit="J"), Cell(text, value=share, unit="%")

    rows = [row("from", posting.label, posting.energy) for posting in books.sources]
    rows += [row("to", posting.label, posting.energy) for posting in books.sinks]
    rows.append(row("", "closing error", books.closing_error))
    return text_table(["", "place", "energy", "fraction of the supplied energy"], rows)


def _signal_errors(errors: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> list[Details]:
    """Return the numerical error of each recorded signal, if it was estimated."""
    rows = [
        (label, name, amount_cell(error["rms"], unit, 2), amount_cell(error["max"], unit, 2))
        for label, signals in errors.items()
        for name, error in signals.items()
        for unit in (difference_unit(error["unit"]),)
    ]
    if not rows:
        return []
    table = text_table(["run", "signal", "rms", "largest"], rows)
    return [Details("Numerical error of recorded signals", [TableBlock(table)])]


# --- The tested bench of a study


def tested_line(plan: StudyPlan) -> str:
    """Return a line about the bench of a study, with its faults."""
    line = plan.bench.summary([each.name for each in plan.varied])
    names = [fault.mode.name for fault in plan.bench.injections]
    if not names:
        return line
    return f"{line}, with the fault{'s' * (len(names) > 1)} {', '.join(names)}"


def tested_brief(nominal: Result, plan: StudyPlan) -> list[Block]:
    """Return faults and varied quantities for a terminal."""
    names = ", ".join(each.name for each in plan.varied)
    faults = [*choice_texts(nominal.bench), *fault_texts(nominal.bench, nominal.recorded)]
    listed = Listing([*faults, *([f"varied: {names}"] if names else [])])
    return [listed, Details("", [Listing(varied_texts(plan.varied))])]


def varied_texts(varied: Sequence[Varied]) -> list[str]:
    """Return a sentence about each varied quantity."""
    return [clean(f"{each.name} varies: {each.distribution.text}") for each in varied]


def tested_section(nominal: Result, source: StudiedBench | None, subject: Subject) -> Section:
    """Return the bench's origin, faults, changes and options.

    Parameters
    ----------
    nominal
        Result of the nominal bench.
    source
        Origin of the bench, or None if unknown.
    subject
        The bench with its changes.
    """
    faults = [*choice_texts(nominal.bench), *fault_texts(nominal.bench, nominal.recorded)]
    blocks: list[Block] = [Paragraph(f"{_source_text(source)}.")] if source is not None else []
    blocks += [Listing(faults)] if faults else []
    blocks += [subject.changes_block, _options_in_use(nominal.bench)]
    return Section("Tested bench", blocks)


def tested_data(bench: Bench, source: StudiedBench | None) -> dict[str, Any]:
    """Return the bench for JSON.

    Values are SI numbers. The study's changes and settings are strings with units. The end of a
    permanent fault is None.
    """
    return {
        "file": None if source is None else source.bench,
        "set": {} if source is None else dict(source.changes),
        "experiment": bench.experiment,
        "parameters": bench.parameters,
        "changes": {
            each.name: {"value": each.now, "instead_of": each.before}
            for each in bench_changes(bench)
        },
        "options": bench.chosen_options.model_dump(mode="json"),
        "faults": [
            {
                "fault": fault.mode.name,
                "summary": fault.mode.summary,
                "value": fault.value if fault.mode.unit else None,
                "unit": fault.mode.unit or None,
                "onset": fault.course.onset,
                "end": fault.course.end if math.isfinite(fault.course.end) else None,
            }
            for fault in bench.injections
        ],
    }


def _source_text(source: StudiedBench) -> str:
    """Return the bench that the study file specifies, and the study's settings for it."""
    changes = ", ".join(f"{name} = {value}" for name, value in source.changes.items())
    return clean(f"Bench: {source.bench}" + (f"; the study sets {changes}" if changes else ""))
