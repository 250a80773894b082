"""``NAME_parameters.c``: the values of a bench, with what they are and where they come from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bywire.core.catalog import PARAMETER_SETS
from bywire.core.provenance import Cited
from bywire.export.controller.c_text import c_name, comment
from bywire.export.controller.derived import values
from bywire.export.controller.program import Program
from bywire.export.controller.values import Nodes, Shape


def parameter_file(program: Program, memory: Any, cited: Mapping[str, Cited]) -> str:
    """Return the C of parameters and initial memory.

    Parameters
    ----------
    memory
        Memory with which the bench begins.
    cited
        Values of the parameter set with their provenance, by dotted name.
    """
    name = program.name
    parts = [comment([f"Values of {program.model.name}, SI units."]), f'#include "{name}_ecu.h"']
    if program.parameters():
        parts.append(parameter_values(program, f"{name}_parameters", program.par, cited))
    literal = program.precision.literal
    fields = [
        f"    .{c_name(each.name)} = {literal(getattr(memory, each.name))},"
        for each in program.members(program.model.Memory)
    ]
    fields += [f"    .{step.status} = 0u," for step in program.steps]
    body = "\n".join(fields)
    parts.append(f"const {name}_Memory {name}_initial_memory = {{\n{body}\n}};")
    return "\n\n".join(parts) + "\n"


def parameter_values(
    program: Program, name: str, par: Any, cited: Mapping[str, Cited] | None
) -> str:
    """Return the definition of parameters in C; without provenance there are no comments."""
    number: Any = np.float32 if program.precision.name == "single" else float
    made = values(program.derived, par, program.constants, number)
    body = "\n".join(_group(program, program.shape, par, "", cited, made, "    "))
    return f"const {program.name}_Parameters {name} = {{\n{body}\n}};"


def _group(
    program: Program,
    shape: Shape,
    group: Any,
    prefix: str,
    cited: Mapping[str, Cited] | None,
    made: Mapping[str, Any],
    indent: str,
) -> list[str]:
    literal = program.precision.literal
    lines: list[str] = []
    for member in program.structs.kept(program.structs.of_group(shape)):
        place = f"{indent}.{c_name(member.name)} ="
        dotted = f"{prefix}{member.name}"
        if member.is_derived:
            if cited is not None:
                lines.append(comment([member.note], indent))
            # No law reads it of a set of parameters that no call is given.
            lines.append(f"{place} {literal(made.get(c_path(dotted), 0.0))},")
            continue
        kind, value = shape.by_name[member.name], getattr(group, member.name)
        if isinstance(kind, Shape):
            inner = _group(program, kind, value, f"{dotted}.", cited, made, indent + "    ")
            lines += [f"{place} {{", *inner, f"{indent}}},"]
            continue
        nodes = [literal(each) for each in value] if isinstance(kind, Nodes) else []
        text = f"{{{', '.join(nodes)}}}" if nodes else literal(value)
        if cited is not None:
            lines.append(comment([f"{member.note}; {_source(dotted, value, cited)}"], indent))
        lines.append(f"{place} {text},")
    return lines


def c_path(dotted: str) -> str:
    """Return the way to a parameter in the words of C."""
    return ".".join(map(c_name, dotted.split(".")))


def _source(name: str, value: Any, cited: Mapping[str, Cited]) -> str:
    known = cited.get(name)
    if known is None or known.value != value:
        return "set by the bench"
    return f"{known.kind}{f': {known.where}' if known.where else ''}"


def provenance(parameters: str) -> Mapping[str, Cited]:
    """Return the values of a parameter set with their provenance."""
    return PARAMETER_SETS.find(parameters).values
