"""The C files of an ECU: header, laws, and the plant's side of its ticks."""

from __future__ import annotations

from collections.abc import Iterable

from bywire.export.controller.c_text import comment, wrapped
from bywire.export.controller.elementary import elementary, headers
from bywire.export.controller.functions import CFunction
from bywire.export.controller.program import Program, Step
from bywire.export.controller.statements import Statement
from bywire.export.controller.structs import Struct

_OPS = "bywire.core.ops"


def header(program: Program) -> str:
    """Return ``NAME_ecu.h``: structures of memory, inputs and parameters, and the functions."""
    name = program.name
    structs = [struct for struct in program.structs.ordered() if struct.public]
    prototypes = [f"void {name}_ecu_init({name}_Memory *memory);"]
    if program.derived:
        said = "Renew what follows from other parameters: where these were changed, before a step."
        prototypes += ["", comment([said]), f"{_derive(program)};"]
    for step in program.steps:
        text = f"Once every {step.task.period:.9g} s: task {step.task.name}."
        prototypes += ["", comment([text]), wrapped(f"{_signature_of(step)};")]
    parts = [
        comment([f"The ECU of {program.model.name}, {program.precision.name} precision.",
                 "Written by bywire; a change belongs into the Python of the law."]),
        f"#ifndef {name.upper()}_ECU_H\n#define {name.upper()}_ECU_H",
        *(_struct(program, each) for each in structs),
        *_data(program),
        comment(["Set the memory with which the bench begins."]) + "\n" + "\n".join(prototypes),
        "#endif",
    ]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def _data(program: Program) -> list[str]:
    name = program.name
    data = []
    if program.parameters():
        data.append(comment(["Parameters of the bench."])
                    + f"\nextern const {name}_Parameters {name}_parameters;")  # fmt: skip
    data.append(comment(["Memory with which it begins."])
                + f"\nextern const {name}_Memory {name}_initial_memory;")  # fmt: skip
    return data


def operations(program: Program) -> str:
    """Return ``NAME_ops.h``: elementary functions as Python has them, and constants."""
    name, real = program.name, program.precision.real
    parts = [comment(["Elementary functions, with the meaning that they have in Python."]),
             f"#ifndef {name.upper()}_OPS_H\n#define {name.upper()}_OPS_H",
             "#include <stdbool.h>"]  # fmt: skip
    ours = {use[1] for use in program.uses if use[0] == "own"}
    named = [*headers(ours), *(["math"] if program.libraries else [])]
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
    return "\n\n".join([*parts, "#endif"]) + "\n"


def _lines_wrapped(text: str) -> str:
    lines = []
    for line in text.splitlines():
        rest = line.lstrip()
        lines.append(wrapped(rest, line[: len(line) - len(rest)]))
    return "\n".join(lines)


def _of_ops(program: Program) -> list[CFunction]:
    return [each for each in program.functions if each.module == _OPS]


def _plant(program: Program) -> list[CFunction]:
    return [each for each in program.functions if each.is_plant and each.module != _OPS]


def _laws(program: Program) -> list[CFunction]:
    return [each for each in program.functions if not each.is_plant and each.module != _OPS]


def io_header(program: Program) -> str:
    """Return ``NAME_io.h``: what a target brings instead, converters and limits."""
    name = program.name
    functions = _plant(program)
    structs = _needed_by(program, functions)
    parts = [
        comment(["The plant's side of the ticks: converters, sensors, limits of the power stage.",
                 "On a target the hardware, or its drivers, take the place of these functions."]),
        f"#ifndef {name.upper()}_IO_H\n#define {name.upper()}_IO_H",
        f'#include <stdbool.h>\n#include "{name}_ecu.h"',
        *(_struct(program, each) for each in structs),
        *(wrapped(f"{signature(each)};") for each in functions),
        "#endif",
    ]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def io_source(program: Program) -> str:
    """Return ``NAME_io.c``."""
    name = program.name
    parts = [comment(["The plant's side of the ticks."]),
             f'#include "{name}_io.h"\n#include "{name}_ops.h"']  # fmt: skip
    return "\n\n".join([*parts, *(_function(program, f) for f in _plant(program))]) + "\n"


def source(program: Program) -> str:
    """Return ``NAME_ecu.c``: laws, init, and the step of every task."""
    name = program.name
    laws = _laws(program)
    shown = {each.name for each in _needed_by(program, _plant(program))}
    structs = [
        each for each in program.structs.ordered() if not each.public and each.name not in shown
    ]
    includes = [f'#include "{name}_ecu.h"', f'#include "{name}_io.h"', f'#include "{name}_ops.h"']
    if not _plant(program):
        includes.pop(1)
    init = (f"void {name}_ecu_init({name}_Memory *memory)\n{{\n"
            f"    *memory = {name}_initial_memory;\n}}")  # fmt: skip
    parts = [
        comment([f"The ECU of {program.model.name}: its laws, and its tasks."]),
        "\n".join(includes),
        *(_struct(program, each) for each in structs),
        *(_function(program, each, "static ") for each in laws),
        init,
        *_derivation(program),
        *(_step(each) for each in program.steps),
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
    return bool(_plant(program))


def _needed_by(program: Program, functions: Iterable[CFunction]) -> list[Struct]:
    """Return the structures of the plant's side that the header of the ECU does not show."""
    names: set[str] = set()
    for each in functions:
        names |= {a.declaration.removeprefix("const ").split()[0] for a in each.arguments}
        names.add(each.result)
        names |= {s.ctype for s in each.statements}
        names |= {use[1] for use in each.uses if use[0] == "struct"}
    known = {each.name: each for each in program.structs.ordered()}
    waiting = [known[n] for n in names if n in known]
    while waiting:
        for member in program.structs.kept(waiting.pop()):
            if member.ctype in known and member.ctype not in names:
                names.add(member.ctype)
                waiting.append(known[member.ctype])
    return [each for each in known.values() if each.name in names and not each.public]


def _struct(program: Program, struct: Struct) -> str:
    lines = [comment([struct.doc])] if struct.doc else []
    lines.append("typedef struct {")
    for member in program.structs.kept(struct):
        note = f" {comment([member.note])}" if member.note else ""
        lines.append(f"    {member.declaration}{note}")
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


def _step(step: Step) -> str:
    lines = [wrapped(_signature_of(step)), "{", *_statements(step.statements, set())]
    if step.result is not None:
        lines.append(wrapped(f"*memory = {step.result.text};", "    "))
    return "\n".join([*lines, "}"])
