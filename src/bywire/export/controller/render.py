"""The C files of an ECU: header, laws, the plant's side of its ticks, and parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from bywire.core.catalog import PARAMETER_SETS, Cited
from bywire.export.controller.body import Statement
from bywire.export.controller.c_text import BEGIN_C, END_C, c_name, comment, wrapped
from bywire.export.controller.contract import INPUT, RESULT, CheckedInput
from bywire.export.controller.derived import values
from bywire.export.controller.elementary import contract_functions, elementary
from bywire.export.controller.functions import CFunction
from bywire.export.controller.program import OPS, Program, Step
from bywire.export.controller.structs import Struct
from bywire.export.controller.values import Nodes, Shape


def header(program: Program) -> str:
    """Return ``NAME_ecu.h``: structures of memory, inputs and parameters, and the functions."""
    name = program.name
    structs = [struct for struct in program.structs.ordered() if struct.public]
    prototypes = [f"void {name}_ecu_init({name}_Memory *memory);"]
    if program.derived:
        said = "Renew what follows from other parameters: where these were changed, before a step."
        prototypes += ["", comment([said]), f"{_derive(program)};"]
    for step in program.steps:
        text = f"Once every {step.task.period:.9g} s: task {step.task.name}. Sets {step.status}."
        prototypes += ["", comment([text]), wrapped(f"{_signature_of(step)};")]
    parts = [
        comment(
            [
                f"The ECU of {program.model.name}, {program.precision.name} precision.",
                "Written by bywire; a change belongs into the Python of the law.",
            ]
        ),
        f"#ifndef {name.upper()}_ECU_H\n#define {name.upper()}_ECU_H",
        "#include <stdint.h>",
        _statuses(program),
        BEGIN_C,
        *(_struct(program, each) for each in structs),
        *_data(program),
        comment(["Set the memory with which the bench begins."]) + "\n" + "\n".join(prototypes),
        END_C,
        "#endif",
    ]
    return "\n\n".join(parts) + "\n"


def _statuses(program: Program) -> str:
    """Return what the status of a step may be."""
    name = program.name.upper()
    said = "Status of a step, 0 where it was as it should be; README.txt says what follows."
    return (
        f"{comment([said])}\n"
        f"#define {name}_STATUS_INPUT {INPUT}u /* an input was refused, the memory stays */\n"
        f"#define {name}_STATUS_RESULT {RESULT}u /* a result was none, the memory began anew */"
    )


def _data(program: Program) -> list[str]:
    name = program.name
    data = []
    if program.parameters():
        data.append(
            comment(["Parameters of the bench."])
            + f"\nextern const {name}_Parameters {name}_parameters;"
        )
    data.append(
        comment(["Memory with which it begins."])
        + f"\nextern const {name}_Memory {name}_initial_memory;"
    )
    return data


def operations(program: Program) -> str:
    """Return ``NAME_ops.h``: elementary functions as Python has them, and constants."""
    name, real = program.name, program.precision.real
    parts = [
        comment(["Elementary functions, with the meaning that they have in Python."]),
        f"#ifndef {name.upper()}_OPS_H\n#define {name.upper()}_OPS_H",
        "#include <stdbool.h>\n#include <stdint.h>\n#include <string.h>",
    ]
    ours = {use[1] for use in program.uses if use[0] == "own"}
    named = ["math"] if program.libraries else []
    parts[-1] += "".join(f"\n#include <{each}.h>" for each in named)
    if program.constants:
        literal = program.precision.literal
        parts.append("\n".join(f"#define {n} ({literal(v)})" for n, v in program.constants.items()))
    for each, sign, said in (("larger", ">", "larger"), ("smaller", "<", "smaller")):
        if each in ours:
            parts.append(
                f"{comment([f'Return the {said} of two; the first of equal ones.'])}\n"
                f"static inline {real} {each}({real} x, {real} y)\n{{\n"
                f"    return (y {sign} x) ? y : x;\n}}"
            )
    parts += map(_lines_wrapped, elementary(ours, program.precision))
    parts += [_function(program, each, "static inline ") for each in _of_ops(program)]
    has_limits = any(not c.is_input for step in program.steps for c in step.commands)
    parts += contract_functions(program.precision, has_limits)
    return "\n\n".join([*parts, "#endif"]) + "\n"


def _lines_wrapped(text: str) -> str:
    lines = []
    for line in text.splitlines():
        rest = line.lstrip()
        lines.append(wrapped(rest, line[: len(line) - len(rest)]))
    return "\n".join(lines)


def _of_ops(program: Program) -> list[CFunction]:
    return [each for each in program.functions if each.module == OPS]


def _laws(program: Program) -> list[CFunction]:
    return [each for each in program.functions if not each.is_plant and each.module != OPS]


def io_header(program: Program) -> str:
    """Return ``NAME_io.h``: what a target brings instead, converters and limits."""
    name = program.name
    functions = program.plant_functions
    parts = [
        comment(
            [
                "The plant's side of the ticks: converters, sensors, limits of the power stage.",
                "On a target the hardware, or its drivers, take the place of these functions.",
            ]
        ),
        f"#ifndef {name.upper()}_IO_H\n#define {name.upper()}_IO_H",
        f'#include <stdbool.h>\n#include "{name}_ecu.h"',
        BEGIN_C,
        *(_struct(program, each) for each in program.shown()),
        *(wrapped(f"{signature(each)};") for each in functions),
        END_C,
        "#endif",
    ]
    return "\n\n".join(parts) + "\n"


def io_source(program: Program) -> str:
    """Return ``NAME_io.c``."""
    name = program.name
    parts = [
        comment(["The plant's side of the ticks."]),
        f'#include "{name}_io.h"\n#include "{name}_ops.h"',
    ]
    return "\n\n".join([*parts, *(_function(program, f) for f in program.plant_functions)]) + "\n"


def source(program: Program) -> str:
    """Return ``NAME_ecu.c``: laws, init, and the step of every task."""
    name = program.name
    laws = _laws(program)
    shown = {each.name for each in program.shown()}
    structs = [
        each for each in program.structs.ordered() if not each.public and each.name not in shown
    ]
    includes = [f'#include "{name}_ecu.h"', f'#include "{name}_io.h"', f'#include "{name}_ops.h"']
    if not program.plant_functions:
        includes.pop(1)
    init = (
        f"void {name}_ecu_init({name}_Memory *memory)\n{{\n    *memory = {name}_initial_memory;\n}}"
    )
    parts = [
        comment([f"The ECU of {program.model.name}: its laws, and its tasks."]),
        "\n".join(includes),
        *(_struct(program, each) for each in structs),
        *(_function(program, each, "static ") for each in laws),
        init,
        *_derivation(program),
        *(_step(program, each) for each in program.steps),
    ]
    return "\n\n".join(parts) + "\n"


def _derive(program: Program) -> str:
    return f"void {program.name}_ecu_derive({program.name}_Parameters *par)"


def _derivation(program: Program) -> list[str]:
    """Return the function that computes what follows from parameters."""
    if not program.derived:
        return []
    lines = [wrapped(each.statement, "    ") for each in program.derived]
    return ["\n".join([_derive(program), "{", *lines, "}"])]


def has_io(program: Program) -> bool:
    """Return whether the ticks have a plant's side."""
    return bool(program.plant_functions)


def _struct(program: Program, struct: Struct) -> str:
    lines = [comment([struct.doc])] if struct.doc else []
    lines.append("typedef struct {")
    for member in program.structs.kept(struct):
        note = f" {comment([member.note])}" if member.note else ""
        lines.append(f"    {member.declaration}{note}")
    if struct.is_memory:
        lines += [f"    uint32_t {s.status}; {comment([_status_note(s)])}" for s in program.steps]
    return "\n".join([*lines, f"}} {struct.name};"])


def signature(function: CFunction) -> str:
    """Return result, name and arguments of a function."""
    declared = []
    for each in function.arguments:
        fixed = each.name in function.moving or each.declaration.startswith("const ")
        declared.append(each.declaration if fixed else f"const {each.declaration}")
    return f"{function.result} {function.name}({', '.join(declared) or 'void'})"


def _function(program: Program, function: CFunction, before: str = "") -> str:
    lines = [comment(function.description), wrapped(before + signature(function)), "{"]
    own = {each.name for each in function.arguments}
    lines += _statements(function.statements, own)
    if function.returned is not None:
        lines.append(wrapped(f"return {function.returned.text};", "    "))
    return "\n".join([*lines, "}"])


def _statements(statements: Iterable[Statement], declared: set[str]) -> list[str]:
    every = list(statements)
    times: dict[str, int] = {}
    for each in every:
        for target in (each.target, *each.changes):
            times[target] = times.get(target, 0) + 1
    known, lines = set(declared), []
    for each in every:
        if each.notes:
            lines.append(comment(list(each.notes), "    "))
        if each.member:
            place = f"{each.target}{'->' if each.is_pointer else '.'}{each.member}"
            text = f"{place} = {each.value.text};"
        elif not each.target:
            text = f"{'' if each.ctype == 'void' else '(void)'}{each.value.text};"
        elif each.target in known:
            text = f"{each.target} = {each.value.text};"
        else:
            constant = "const " if times[each.target] == 1 else ""
            value = each.value.text
            compound = f"({each.ctype}){{"
            if value.startswith(compound):
                value = value[len(compound) - 1 :]
            text = f"{constant}{each.ctype} {each.target} = {value};"
            known.add(each.target)
        lines.append(wrapped(text, "    "))
    return lines


def _signature_of(step: Step) -> str:
    return f"void {step.name}({', '.join(text for text, _ in step.arguments)})"


def _status_note(step: Step) -> str:
    return f"of the last call of {step.name}, 0: as it should be"


def _step(program: Program, step: Step) -> str:
    """Return the function of a task: inputs are checked before it, memory and commands behind."""
    name = program.name
    body = _statements(step.statements, set())
    if step.result is not None:
        body.append(wrapped(f"*memory = {step.result.text};", "    "))
    of_inputs = [
        f"    memory->{c_name(each.field)} = smaller(memory->{c_name(each.field)}, "
        f"{each.limit.text});"
        for each in step.commands
        if each.is_input
    ]
    if step.kept:
        numbers = _all([f"is_usual(memory->{c_name(each)})" for each in step.kept], "            ")
        body += [
            f"    if (!({numbers})) {{",
            f"        {name}_ecu_init(memory);",
            f"        status = {name.upper()}_STATUS_RESULT;",
            "    }",
        ]
    body += of_inputs
    checks = [check for each in step.inputs for check in _checks(program, each)]
    begin = "0u"
    if checks:
        begin = f"{name.upper()}_STATUS_INPUT"
        body.insert(0, "    status = 0u;")
        body = [
            f"    if ({_all(checks, '            ')}) {{",
            *("\n".join(f"    {row}" for row in line.split("\n")) for line in body),
            "    }",
        ]
    limited = [
        wrapped(
            f"memory->{c_name(each.field)} = within(memory->{c_name(each.field)}, "
            f"{each.limit.text});",
            "    ",
        )
        for each in step.commands
        if not each.is_input
    ]
    return "\n".join(
        [
            wrapped(_signature_of(step)),
            "{",
            f"    uint32_t status = {begin};",
            "",
            *body,
            *limited,
            f"    memory->{step.status} = status;",
            "}",
        ]
    )


def _all(checks: list[str], indent: str) -> str:
    return f"\n{indent}&& ".join(checks)


def _checks(program: Program, each: CheckedInput) -> list[str]:
    """Return what has to hold of an input."""
    place, literal = f"{each.kind}->{c_name(each.field)}", program.precision.literal
    ends = [(">=", each.low), ("<=", each.high)]
    return [f"is_usual({place})"] + [
        f"({place} {sign} {literal(end)})" for sign, end in ends if math.isfinite(end)
    ]


# --- ``NAME_parameters.c``: the values of a bench, what they are and where they come from


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
