"""What ``bywire list NAME`` shows of one parameter, a group of them, and a key figure."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from bywire.api.option_rows import option_rows
from bywire.bench.experiment import EXPERIMENTS
from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.core.field_notes import field_notes
from bywire.core.quantities import display_unit

Object = dict[str, Any]


@cache
def parameters() -> Mapping[str, str]:
    """Return the assembly of every parameter by dotted name; none is in two."""
    found = {}
    for assembly in sorted({e.assembly for e in PARAMETER_SETS.all().values()}):
        for name in field_notes(PARAMETER_SETS.find(main_set(assembly)).parameter_class):
            found[name] = assembly
    return found


def groups() -> Mapping[str, str]:
    """Return the assembly of every group of parameters, such as ``motor``, by name."""
    return {name.rpartition(".")[0]: one for name, one in parameters().items() if "." in name}


def described_parameter(name: str) -> Object:
    """Return unit, range and meaning of a parameter, and its value in every set."""
    assembly, values = parameters()[name], []
    for one in PARAMETER_SETS.all().values():
        if one.assembly == assembly:
            rows = option_rows(one.parameter_class, one.parameters())
            (row,) = (row for row in rows if row["name"] == name)
            values.append({"parameter set": one.name, "value": row["value"]})
    return {
        "summary": row["meaning"], "assembly": assembly, "unit": row["unit"], "range": row["range"],
        "values": values, "see": f"changed with --set {name}=VALUE",
    }  # fmt: skip


def described_group(name: str) -> Object:
    """Return the parameters of a group, with the values of the assembly's main set."""
    assembly = groups()[name]
    one = PARAMETER_SETS.find(main_set(assembly))
    rows = [row for row in option_rows(one.parameter_class, one.parameters())
            if row["name"].rpartition(".")[0] == name]  # fmt: skip
    return {"summary": f"parameters, with the values of {one.name}", "assembly": assembly,
            "parameters": rows, "changed_with": "--set NAME=VALUE"}  # fmt: skip


def described_kpi(name: str, definition: str) -> Object:
    """Return a key figure's meaning, its unit, and the experiments that tell it."""
    known = {e.name: e.kpis[name] for e in EXPERIMENTS.all().values() if name in e.kpis}
    units = sorted({display_unit(unit) for unit in known.values()})
    return {"summary": definition, "unit": " or ".join(units), "experiments": ", ".join(known)}
