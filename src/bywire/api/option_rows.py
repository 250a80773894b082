"""What a parameter set consists of, for listings: value, unit, range and meaning of each field."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from bywire.core.field_notes import field_notes
from bywire.core.leaf import Leaf
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.quantities import display_unit

if TYPE_CHECKING:
    from bywire.report.tables import Table


def option_rows(
    cls: type[ParameterSet], values: ParameterSet | None, simulated: Collection[str] = ()
) -> list[dict[str, Any]]:
    """Return a row for every number and choice of a parameter class, in their order.

    Parameters
    ----------
    cls
        The class.
    values
        What is taken unless something else is given; None where everything has to be given.
    simulated
        First parts of the names of those that only shape simulated experiments.
    """
    from bywire.report.tables import value_text

    leaves, notes = leaf_fields(cls), field_notes(cls)
    known: Mapping[str, Any] = {} if values is None else values.flat()
    rows = []
    for name in notes:
        leaf = leaves.get(name)
        unit = "1" if leaf is None else leaf.unit.symbol
        meaning = " ".join(notes[name].split())
        if name.split(".")[0] in simulated and "synthetic" not in meaning:
            meaning += " (simulated experiments)"
        rows.append({
            "name": name,
            "value": value_text(known[name], unit) if name in known else None,
            "unit": "" if leaf is None else display_unit(unit),
            "range": _choices(cls, name) if leaf is None else _range(leaf),
            "meaning": meaning,
        })  # fmt: skip
    return rows


def option_table(rows: Sequence[Mapping[str, Any]], heading: str) -> Table:
    """Return these rows as a table whose values stand under a heading."""
    from bywire.report.tables import text_table

    columns = ["name", "value", "range", "meaning"]
    if all(row["value"] is None for row in rows):
        columns.remove("value")
    titles = [heading if name == "value" else name for name in columns]
    return text_table(titles, [[row[name] or "-" for name in columns] for row in rows])


def _range(leaf: Leaf) -> str:
    from bywire.report.wording import range_text, unit_text

    bounded = math.isfinite(leaf.low) or math.isfinite(leaf.high)
    unit = unit_text(display_unit(leaf.unit.symbol))
    return range_text(leaf) + ("" if bounded or not unit else f" in {unit}")


def _choices(cls: type[ParameterSet], name: str) -> str:
    """Return what a choice may be."""
    *groups, last = name.split(".")
    for group in groups:
        cls = cls.model_fields[group].annotation  # type: ignore[assignment]
    annotation = cls.model_fields[last].annotation
    if annotation is bool:
        return "true or false"
    if get_origin(annotation) is not Literal:
        return "-"
    *first, end = map(str, get_args(annotation))
    return f"{', '.join(first)} or {end}" if first else end
