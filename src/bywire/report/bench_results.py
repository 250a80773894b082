"""Results of a bench as tables and as a JSON object; loads no plotting."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from bywire.bench.energy_ledger import Ledger, actuator_ledger, disc_ledger
from bywire.bench.result import Result
from bywire.report.tables import KpiRow, Table, text_table
from bywire.report.wording import amount


def as_json(result: Result, files: list[Path]) -> dict[str, Any]:
    """Return the object that ``bywire run --json`` prints; undefined KPIs are null."""
    return {
        "bench": result.bench.name or result.bench.experiment,
        "status": result.status,
        "kpis": {
            kpi.name: {"value": _number(kpi.value), "unit": kpi.unit, "note": kpi.note}
            for kpi in result.kpis
        },
        "requirements": [
            {
                "kpi": v.kpi,
                "limit": v.limit,
                "value": _number(v.value),
                "unit": v.unit,
                "met": v.met,
            }
            for v in result.verdicts
        ],
        "energy": energy_objects(result),
        "warnings": result.warnings,
        "files": [str(path) for path in files],
    }


def energy_ledgers(result: Result) -> dict[str, Ledger]:
    """Return the books of every run from time zero on, those with the disc apart, by label."""
    found = {}
    for label, recording in result.recordings.items():
        if "E_stored" not in recording or recording["E_stored"].dims != ("time",):
            continue
        after = recording.sel(time=slice(-1e-9, None))
        if after.sizes["time"] < 2:
            continue
        found[label] = actuator_ledger(after)
        with_disc = disc_ledger(after)
        if with_disc is not None:
            found[f"{label}, with disc"] = with_disc
    return found


def energy_objects(result: Result) -> dict[str, Any]:
    """Return the books as JSON: energies [J] by place; sources less sinks is the closing error."""
    return {
        label: {
            "unit": "J",
            "sources": {one.name: one.energy for one in books.sources},
            "sinks": {one.name: one.energy for one in books.sinks},
            "closing_error": books.closing_error,
        }
        for label, books in energy_ledgers(result).items()
    }


def energy_table(books: Ledger) -> Table:
    """Return a ledger as a table: place, energy, share of what was turned over."""
    total = books.turnover

    def row(side: str, label: str, energy: float) -> tuple[str, str, str, str]:
        share = f"{100.0 * energy / total:.3g} %" if total > 0 else "-"
        return side, label, amount(energy, "J"), share

    rows = [row("from", one.label, one.energy) for one in books.sources]
    rows += [row("to", one.label, one.energy) for one in books.sinks]
    rows.append(row("", "closing error", books.closing_error))
    return text_table(["", "place", "energy", "share of what was given"], rows)


def kpi_rows(result: Result) -> list[KpiRow]:
    """Return the KPIs beside their requirements."""
    verdicts = {v.kpi: v for v in result.verdicts}
    rows = []
    for kpi in result.kpis:
        verdict = verdicts.get(kpi.name)
        definition = f"{kpi.definition} ({kpi.note})" if kpi.note else kpi.definition
        rows.append(
            KpiRow(
                kpi.name,
                kpi.value,
                kpi.unit,
                definition,
                verdict.limit if verdict else "",
                verdict.met if verdict else None,
            )
        )
    return rows


def _number(value: float) -> float | None:
    return None if math.isnan(value) or math.isinf(value) else value
