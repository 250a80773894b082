"""What a bench run leaves in its folder: recordings, results, figures, one HTML page."""

from __future__ import annotations

import json
from pathlib import Path

from bywire.bench.result import Result
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import FileError
from bywire.data.netcdf import write_recording
from bywire.report.bench_figures import Shown, bench_figures
from bywire.report.bench_results import as_json, energy_ledgers, energy_table, kpi_rows
from bywire.report.files import save_figure, write_bytes
from bywire.report.page import (
    Banner,
    Block,
    Details,
    FigureBlock,
    Paragraph,
    Section,
    TableBlock,
    write_page,
)
from bywire.report.parameter_rows import parameter_rows
from bywire.report.tables import kpi_table, parameter_table


def write_result(result: Result, folder: Path) -> list[Path]:
    """Write everything a result has to show; each file whole or not at all.

    Raises
    ------
    FileError
        When the folder cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"cannot make the output folder {folder}: {error.strerror}") from None
    files = [
        write_recording(recording, folder / f"{label}.nc")
        for label, recording in result.recordings.items()
    ]
    if result.status != "interrupted":
        shown = bench_figures(result)
        files += [save_figure(s.figure, folder / f"{s.name}.png") for s in shown]
        files.append(_page(result, shown, folder / "report.html"))
    target = folder / "result.json"
    text = json.dumps(as_json(result, [*files, target]), indent=2)
    files.append(write_bytes(target, text.encode()))
    return files


def _page(result: Result, shown: list[Shown], path: Path) -> Path:
    bench = result.bench
    cited = PARAMETER_SETS.find(bench.parameters)
    met = sum(v.met for v in result.verdicts)
    verdict = "none" if not result.verdicts else "good" if result.status == "passed" else "bad"
    text = f"{met} of {len(result.verdicts)} requirements met" if result.verdicts else "done"
    notes: list[Block] = [Paragraph(f"Warning: {w}.") for w in result.warnings]
    sections = [
        Section("Key figures", [*notes, TableBlock(kpi_table(kpi_rows(result)))]),
        Section("Figures", [FigureBlock(s.figure, s.caption) for s in shown]),
        *_energy(result),
        Section(
            "How it was made",
            [
                Paragraph(f"Source of the parameters: {cited.source}."),
                Paragraph(_provenance(result)),
                Details(
                    "Options of the experiment",
                    [TableBlock(parameter_table(parameter_rows(bench.chosen_options)))],
                ),
                Details(
                    "All parameters",
                    [TableBlock(parameter_table(parameter_rows(bench.par, cited.values)))],
                ),
            ],
        ),
    ]
    return write_page(
        path,
        bench.name or bench.experiment,
        f"{bench.definition.summary}; parameter set {bench.parameters}",
        sections,
        banner=Banner(text, verdict),  # type: ignore[arg-type]
    )


def _energy(result: Result) -> list[Section]:
    """Return the books of every run that keeps any."""
    blocks: list[Block] = []
    for label, books in energy_ledgers(result).items():
        blocks += [Paragraph(f"{label}, from time zero on:"), TableBlock(energy_table(books))]
    return [Section("Energy", blocks)] if blocks else []


def _provenance(result: Result) -> str:
    recording = next(iter(result.recordings.values()))
    kept = ("bywire_version", "parameter_hash", "step", "engine", "status", "seed")
    return "; ".join(f"{k} {recording.attrs[k]}" for k in kept if k in recording.attrs) + "."
