"""What ``bywire identify`` shows: text for the terminal, one object for programs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bywire.report.identification_report import Identification


def as_object(one: Identification, files: Sequence[Path]) -> dict[str, Any]:
    """Return what JSON holds of an identification."""
    from bywire.identification.estimate import as_object as estimate_object

    found = one.found
    made: dict[str, Any] = finite({
        "method": one.method.name,
        "parameter_set": None if one.subject is None else one.subject.parameters,
        "measurement": one.source,
        "options": one.options.model_dump(mode="json", exclude=set(one.idle)),
        "parameters": dict(found.parameters),
        "estimates": {name: estimate_object(e) for name, e in found.estimates.items()},
        "start": _of_estimates(one.start, one),
        "put_in": _of_estimates(one.put_in, one),
        "figures": {
            name: {"value": value, "unit": unit} for name, (value, unit) in found.figures.items()
        },
        "checks": [
            {"name": c.name, "value": c.value, "unit": c.unit, "limit": c.limit,
             "at_least": c.at_least, "holds": c.holds, "note": c.note}
            for c in found.checks
        ],
        "notes": [*one.notes, *found.notes],
        "files": [str(path) for path in files],
    })  # fmt: skip
    return made


def text(one: Identification) -> str:
    """Return what the terminal shows of an identification."""
    from bywire.report.estimate_tables import check_table, estimate_table, figure_table
    from bywire.report.table_text import table_text

    parts = [f"{one.method.name}, {one.source}: {one.method.summary}"]
    for name, estimate in one.found.estimates.items():
        parts.append(f"{name}\n{table_text(estimate_table(estimate, one.start, one.put_in))}")
        said = [f"- {k.unknown.label} is not told by the data: {k.reason}" for k in estimate.kept]
        said += [f"- {note}" for note in estimate.notes]
        parts += ["\n".join(said)] if said else []
    if one.found.figures:
        parts.append(table_text(figure_table(one.found)))
    if one.found.checks:
        parts.append(table_text(check_table(one.found.checks)))
    if one.found.notes:
        parts.append("\n".join(f"- {note}" for note in one.found.notes))
    return "\n\n".join(parts)


def _of_estimates(values: Mapping[str, float], one: Identification) -> dict[str, float]:
    """Return those values that an estimate, or an unknown that is not told, stands beside."""
    labels = [u.label for e in one.found.estimates.values()
              for u in (*e.unknowns, *(k.unknown for k in e.kept))]  # fmt: skip
    return {label: values[label] for label in labels if label in values}


def finite(value: Any) -> Any:
    """Return an object with null for numbers that are infinite or not defined."""
    if isinstance(value, dict):
        return {key: finite(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
