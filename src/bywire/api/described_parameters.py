"""What ``bywire list NAME`` shows of parameters and options: a set, a group, one, a key figure."""

from __future__ import annotations

import inspect
import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from bywire.bench.experiment import EXPERIMENTS
from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.core.field_notes import field_notes
from bywire.core.leaf import Leaf
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.quantities import display_unit

if TYPE_CHECKING:
    from bywire.report.tables import Table


Object = dict[str, Any]


def parameters() -> Mapping[str, tuple[str, ...]]:
    """Return the assemblies of every parameter by dotted name."""
    holders: dict[str, tuple[str, ...]] = {}
    for assembly in sorted({e.assembly for e in PARAMETER_SETS.all().values()}):
        for name in field_notes(PARAMETER_SETS.find(main_set(assembly)).parameter_class):
            holders[name] = (*holders.get(name, ()), assembly)
    return holders


def groups() -> Mapping[str, tuple[str, ...]]:
    """Return the assemblies of every group of parameters, such as ``motor``, by name."""
    holders: dict[str, tuple[str, ...]] = {}
    for name, assemblies in parameters().items():
        group = name.rpartition(".")[0]
        if group:
            holders[group] = tuple(dict.fromkeys((*holders.get(group, ()), *assemblies)))
    return holders


def described_parameter(name: str) -> Object:
    """Return unit, range and meaning of a parameter, and its value in every set."""
    assemblies, values = parameters()[name], []
    descriptions: dict[str, list[str]] = {"meaning": [], "unit": [], "range": []}
    for cited in PARAMETER_SETS.all().values():
        if cited.assembly in assemblies:
            rows = option_rows(cited.parameter_class, cited.parameters())
            (row,) = (row for row in rows if row["name"] == name)
            values.append({"parameter set": cited.name, "value": row["value"]})
            for key, texts in descriptions.items():
                texts += [] if row[key] in texts else [row[key]]
    said = {key: " or ".join(filter(None, texts)) for key, texts in descriptions.items()}
    return {
        "summary": said["meaning"],
        "assembly": ", ".join(assemblies),
        "unit": said["unit"],
        "range": said["range"],
        "values": values,
        "see": f"changed with --set {name}=VALUE",
    }


def described_group(name: str) -> Object:
    """Return the parameters of a group, with the values of each assembly's main set."""
    assemblies = groups()[name]
    rows, sets, meanings = [], [], []
    for assembly in assemblies:
        cited = PARAMETER_SETS.find(main_set(assembly))
        sets.append(cited.name)
        meanings.append(group_meaning(_class_of(cited.parameter_class, name)))
        new = [
            row
            for row in option_rows(cited.parameter_class, cited.parameters())
            if row["name"].rpartition(".")[0] == name
        ]
        if len(assemblies) > 1:
            new = [{**row, "meaning": f"{row['meaning']} ({assembly})".strip()} for row in new]
        rows += new
    about = " or ".join(dict.fromkeys(filter(None, meanings)))
    return {
        "summary": f"{about}; parameters with the values of {' and '.join(sets)}",
        "assembly": ", ".join(assemblies),
        "parameters": rows,
        "changed_with": "--set NAME=VALUE",
    }


def group_meaning(cls: type[ParameterSet]) -> str:
    """Return what a group of parameters is of: an element's module says it, else the class."""
    about = inspect.getdoc(cls) or ""
    if cls.__name__ == "Parameters":
        about = getattr(inspect.getmodule(cls), "__doc__", None) or about
    return " ".join(about.strip().partition("\n\n")[0].split()).rstrip(".")


def _class_of(cls: type[Any], name: str) -> type[Any]:
    for part in name.split("."):
        cls = cls.model_fields[part].annotation
    return cls


def described_kpi(name: str, definition: str) -> Object:
    """Return a key figure's meaning, its unit, and the experiments that tell it."""
    from bywire.report.wording import readable_units

    known = {e.name: e.kpis[name] for e in EXPERIMENTS.all().values() if name in e.kpis}
    units = sorted({readable_units(unit) for unit in known.values()})
    return {"summary": definition, "unit": " or ".join(units), "experiments": ", ".join(known)}


def option_rows(
    cls: type[ParameterSet], values: ParameterSet | None, simulated: Collection[str] = ()
) -> list[dict[str, Any]]:
    """Return a row for every number and choice of a parameter class, in their order.

    Parameters
    ----------
    cls
        The class.
    values
        What is taken unless something else is given; None where the class alone says so.
    simulated
        First parts of the names of those that only shape simulated experiments.
    """
    from bywire.report.tables import value_text

    leaves, notes = leaf_fields(cls), field_notes(cls)
    known: Mapping[str, Any] = _given_by(cls) if values is None else values.flat()
    rows = []
    for name in notes:
        leaf = leaves.get(name)
        unit = "1" if leaf is None else leaf.unit.symbol
        meaning = " ".join(notes[name].split())
        if name.split(".")[0] in simulated and "synthetic" not in meaning:
            meaning += " (simulated experiments)"
        rows.append(
            {
                "name": name,
                "value": value_text(known[name], unit) if name in known else None,
                "unit": "" if leaf is None else display_unit(unit),
                "range": _choices(cls, name) if leaf is None else _range(leaf),
                "meaning": meaning,
            }
        )
    return rows


def _given_by(cls: type[ParameterSet]) -> Mapping[str, Any]:
    """Return what a class takes where nothing is given, by name."""
    fields = cls.model_fields.items()
    return {name: info.default for name, info in fields if not info.is_required()}


def option_table(rows: Sequence[Mapping[str, Any]], heading: str) -> Table:
    """Return these rows as a table whose values stand under a heading."""
    from bywire.report.tables import text_table

    columns = ["name", "value", "range", "meaning"]
    if all(row["value"] is None for row in rows):
        columns.remove("value")
    if any(row.get("provenance") for row in rows):
        columns.append("provenance")
    titles = [heading if name == "value" else name for name in columns]
    return text_table(titles, [[row.get(name) or "-" for name in columns] for row in rows])


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
