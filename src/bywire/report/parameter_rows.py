"""The rows of a parameter table, from a parameter set and the provenance of its values."""

from __future__ import annotations

from collections.abc import Mapping

from bywire.core.field_notes import field_notes
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.provenance import Cited
from bywire.report.tables import ParameterRow
from bywire.report.wording import range_text

OVERRIDDEN = "override"
"""provenance of a value that differs from the cited one"""


def parameter_rows(
    parameters: ParameterSet, provenance: Mapping[str, Cited] | None = None
) -> list[ParameterRow]:
    """Return one row per value of a parameter set, in its order.

    Parameters
    ----------
    parameters
        Values as they were used.
    provenance
        Cited values by dotted name; a value that differs from its citation is marked as an
        override and the cited one is named.
    """
    leaves = leaf_fields(type(parameters))
    notes = field_notes(type(parameters))
    rows = []
    for name, value in parameters.flat().items():
        leaf = leaves.get(name)
        kind, where = _origin((provenance or {}).get(name), value)
        rows.append(
            ParameterRow(
                name=name,
                value=value,
                unit="1" if leaf is None else leaf.unit.symbol,
                range=notes[name] if leaf is None else range_text(leaf),
                kind=kind,
                where=where,
            )
        )
    return rows


def _origin(cited: Cited | None, value: object) -> tuple[str, str]:
    """Return kind and place of a value."""
    if cited is None:
        return "", ""
    if cited.value != value:
        origin = ", ".join(filter(None, (cited.kind, cited.where)))
        return OVERRIDDEN, f"cited: {cited.value} in SI ({origin})"
    return cited.kind, cited.where
