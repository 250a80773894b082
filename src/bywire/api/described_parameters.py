"""What ``bywire list NAME`` shows of one parameter, a group of them, and a key figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.api.option_rows import option_rows
from bywire.bench.experiment import EXPERIMENTS
from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.core.field_notes import field_notes
from bywire.core.quantities import display_unit

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
        "summary": said["meaning"], "assembly": ", ".join(assemblies), "unit": said["unit"],
        "range": said["range"], "values": values, "see": f"changed with --set {name}=VALUE",
    }  # fmt: skip


def described_group(name: str) -> Object:
    """Return the parameters of a group, with the values of each assembly's main set."""
    assemblies = groups()[name]
    rows, sets = [], []
    for assembly in assemblies:
        cited = PARAMETER_SETS.find(main_set(assembly))
        sets.append(cited.name)
        new = [row for row in option_rows(cited.parameter_class, cited.parameters())
               if row["name"].rpartition(".")[0] == name]  # fmt: skip
        if len(assemblies) > 1:
            new = [{**row, "meaning": f"{row['meaning']} ({assembly})".strip()} for row in new]
        rows += new
    return {"summary": f"parameters, with the values of {' and '.join(sets)}",
            "assembly": ", ".join(assemblies), "parameters": rows,
            "changed_with": "--set NAME=VALUE"}  # fmt: skip


def described_kpi(name: str, definition: str) -> Object:
    """Return a key figure's meaning, its unit, and the experiments that tell it."""
    known = {e.name: e.kpis[name] for e in EXPERIMENTS.all().values() if name in e.kpis}
    units = sorted({display_unit(unit) for unit in known.values()})
    return {"summary": definition, "unit": " or ".join(units), "experiments": ", ".join(known)}
