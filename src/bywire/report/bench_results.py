"""Results of a bench as tables and as a JSON object; loads no plotting."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from bywire.bench.result import Result
from bywire.report.tables import KpiRow


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
        "warnings": result.warnings,
        "files": [str(path) for path in files],
    }


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
