"""What may fail in the assemblies that there are numbers for, of every brake."""

from __future__ import annotations

from typing import Any

from bywire.bench.faults.modes import Mode, modes_of
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.model import ASSEMBLIES
from bywire.core.quantities import display_unit
from bywire.report.wording import amount


def faults() -> dict[str, list[tuple[str, Mode]]]:
    """Return every mode by name, each with the assemblies that have it."""
    every: dict[str, list[tuple[str, Mode]]] = {}
    seen = set()
    for cited in PARAMETER_SETS.all().values():
        if cited.assembly in seen or cited.assembly not in ASSEMBLIES.all():
            continue
        seen.add(cited.assembly)
        model = ASSEMBLIES.all()[cited.assembly]()
        for name, mode in modes_of(model, cited.parameters()).items():
            every.setdefault(name, []).append((cited.assembly, mode))
    return every


def fault_summaries() -> dict[str, str]:
    """Return a line on every mode: what happens, and in which assemblies."""
    return {
        name: f"{places[0][1].summary} ({', '.join(assembly for assembly, _ in places)})"
        for name, places in faults().items()
    }


def described_fault(places: list[tuple[str, Mode]]) -> dict[str, Any]:
    """Return all about a mode: its value's unit and default in every assembly."""
    rows = [
        {
            "assembly": assembly,
            "value": amount(mode.value, mode.unit) if mode.unit else "none",
            "unit": display_unit(mode.unit) if mode.unit else "",
        }
        for assembly, mode in places
    ]
    name = places[0][1].name
    return {
        "summary": places[0][1].summary,
        "found in": rows,
        "see": f'put in by [[faults]] of a bench file, or --fault "{name}'
        + ("=VALUE" if places[0][1].unit else "")
        + '@ONSET"',
    }
