"""C programs that test the compiled ECU with test vectors, invalid inputs and arbitrary bits."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

import numpy as np

from bywire.export.controller.c_text import c_name, comment
from bywire.export.controller.contract import LARGEST, CheckedInput
from bywire.export.controller.program import Program
from bywire.export.controller.render import parameter_values
from bywire.export.controller.vectors import Vectors

_BASES, _WILD = 8, 400
"""number of a task's vectors with trials of invalid inputs; number of draws of arbitrary bits"""


def trespassing(program: Program, every: Sequence[Vectors]) -> list[str]:
    """Return the harness functions that count violations of the contract, one for each task."""
    if not every:
        return []
    left = [_left(program)] if any(each.step.inputs for each in every) else []
    return [*left, _drawn(program), *(_breaches(program, each) for each in every)]


def prepared(program: Program, vectors: Vectors) -> list[str]:
    """Return the statements that set up vector ``k`` of a task."""
    name, task = program.name, c_name(vectors.step.task.name)
    types = {"x": f"{name}_Plant", "u": f"{name}_Stimulus", "memory": f"{name}_Memory"}
    wanted = [short for _, short in vectors.step.arguments]
    # A structure that the task does not read contains zeros.
    lines = [f"{types[kind]} {kind} = {{0}};" for kind in ("x", "u", "memory") if kind in wanted]
    for at, (kind, field) in enumerate(vectors.names):
        if kind in wanted:
            lines.append(f"{kind}.{c_name(field)} = given_{task}[k][{at}];")
    if "par" in wanted:
        chosen = f"(other_{task}[k] == 1) ? &other_parameters : &{name}_parameters"
        lines.append(f"const {name}_Parameters *par = {chosen};")
    return [f"        {line}" for line in lines]


def stepped(vectors: Vectors) -> str:
    """Return the call of a task on the variables of ``prepared``."""
    wanted = [short for _, short in vectors.step.arguments]
    arguments = ", ".join(each if each == "par" else f"&{each}" for each in wanted)
    return f"{vectors.step.name}({arguments});"


def _left(program: Program) -> str:
    """Return the function that compares the memory before and after a rejected step."""
    fields = [c_name(each.name) for each in program.members(program.model.Memory)]
    same = [f"is_same(a->{each}, b->{each})" for each in fields] or ["1"]
    return (
        f"/* Return whether two memories contain the same numbers. */\n"
        f"static int is_left(const {program.name}_Memory *a, const {program.name}_Memory *b)\n"
        "{\n    return " + "\n            && ".join(same) + ";\n}"
    )


def _drawn(program: Program) -> str:
    """Return the functions that draw arbitrary bits, often at the ends of the ranges."""
    real = program.precision.real
    return f"""static const {real} special[] = {{
    ({real})NAN, ({real})INFINITY, -({real})INFINITY, {_limits(program)}
}};
static uint32_t drawn = 1u;

static uint32_t draw(void)
{{
    drawn = drawn * 1664525u + 1013904223u;
    return drawn >> 8;
}}

static {real} draw_real(void)
{{
    {real} value;
    unsigned char bytes[sizeof value];

    if (draw() % 4u == 0u) {{
        return special[draw() % (sizeof special / sizeof special[0])];
    }}
    for (unsigned int n = 0; n < sizeof bytes; ++n) {{
        bytes[n] = (unsigned char)draw();
    }}
    memcpy(&value, bytes, sizeof value);
    return value;
}}"""


def _limits(program: Program) -> str:
    kind = np.float32 if program.precision.name == "single" else np.float64
    ends = np.finfo(kind)
    values = (float(ends.max), -float(ends.max), float(ends.tiny), 0.0, 1.0, -1.0, LARGEST)
    return ", ".join(map(program.precision.literal, values))


def _refused(program: Program, each: CheckedInput) -> list[str]:
    """Return values that a step must reject."""
    real, literal = program.precision.real, program.precision.literal
    kind = np.float32 if real == "float" else np.float64
    values = [
        f"({real})NAN",
        f"({real})INFINITY",
        f"-({real})INFINITY",
        literal(LARGEST),
        literal(-LARGEST),
    ]
    for end, away in ((each.low, -math.inf), (each.high, math.inf)):
        if math.isfinite(end):
            beyond = float(np.nextafter(kind(end), kind(away)))
            # The number next to 0 is subnormal, which code may flush to 0. Use a normal number.
            values.append(literal(beyond if abs(beyond) > 1e-30 else math.copysign(1e-6, away)))
    return values


def _breaches(program: Program, vectors: Vectors) -> str:
    task = c_name(vectors.step.task.name)
    lines = [f"static int breaches_{task}(void)", "{", "    int wrong = 0;"]
    if vectors.step.inputs:
        lines += _refusing(program, vectors)
    return "\n".join([*lines, *_wild(program, vectors), "    return wrong;", "}"])


def _refusing(program: Program, vectors: Vectors) -> list[str]:
    """Return the test of invalid inputs, which must leave the memory unchanged."""
    name, step, task = program.name, vectors.step, c_name(vectors.step.task.name)
    status, refused = f"memory.{step.status}", f"{name.upper()}_STATUS_INPUT"
    lines = ["", f"    for (int k = 0; k < VECTORS_{task}; k += 1 + VECTORS_{task} / {_BASES}) {{"]
    lines += [*prepared(program, vectors), f"        {stepped(vectors)}"]
    lines += [
        f"        wrong += ({status} == 0u) ? 0 : 1;",
        f"        const {name}_Memory before = memory;",
    ]
    for each in step.inputs:
        place = f"{each.kind}.{c_name(each.field)}"
        values = _refused(program, each)
        lines += [
            "        {",
            f"            const {program.precision.real} refused[] = {{{', '.join(values)}}};",
            f"            const {program.precision.real} accepted = {place};",
            f"            for (int n = 0; n < {len(values)}; ++n) {{",
            f"                {place} = refused[n];",
            f"                {stepped(vectors)}",
            "                wrong += is_left(&memory, &before) ? 0 : 1;",
            f"                wrong += ({status} == {refused}) ? 0 : 1;",
            "            }",
            f"            {place} = accepted;",
            "        }",
        ]
    return [*lines, "    }"]


def _wild(program: Program, vectors: Vectors) -> list[str]:
    """Return the test of arbitrary bits: memory must stay finite, and commands within limits."""
    name, step, model = program.name, vectors.step, program.model
    short = [each for _, each in step.arguments]
    types = {"x": model.State, "u": model.Stimulus, "memory": model.Memory}
    kinds = {"x": "Plant", "u": "Stimulus", "memory": "Memory"}
    held = [each for each in ("x", "u", "memory") if each in short]
    lines = ["", f"    for (int k = 0; k < {_WILD}; ++k) {{"]
    lines += [f"        {name}_{kinds[each]} {each} = {{0}};" for each in held]
    if "par" in short:
        lines += [
            f"        {name}_Parameters wild = {name}_parameters;",
            f"        const {name}_Parameters *par = &wild;",
        ]
    for each in held:
        for member in program.members(types[each]):
            if each != "memory":
                lines.append(
                    f"        if (draw() % 8u == 0u) {{ {each}.{c_name(member.name)} = "
                    "draw_real(); }"
                )
            else:
                lines.append(f"        {each}.{c_name(member.name)} = draw_real();")
    if "par" in short:
        for dotted, member in program.held():
            place = ".".join(map(c_name, dotted.split(".")))
            last = "[0]" if member.length else ""
            lines.append(f"        if (draw() % 16u == 0u) {{ wild.{place}{last} = draw_real(); }}")
    lines.append(f"        {stepped(vectors)}")
    refused = f"(memory.{step.status} == {name.upper()}_STATUS_INPUT)"
    lines += [
        f"        wrong += ({refused} || (fabs((double)memory.{c_name(each)}) <= {LARGEST!r}))\n"
        "            ? 0 : 1;"
        for each in step.kept
    ]
    for command in step.commands:
        place, limit = f"memory.{c_name(command.field)}", command.limit.text
        if command.is_input:
            limit = limit.replace("u->", "u.", 1)
            lines.append(
                f"        wrong += ((memory.{step.status} != 0u) || ({place} <= {limit})) ? 0 : 1;"
            )
            continue
        lines.append(
            f"        wrong += ({limit} >= {program.precision.literal(0.0)})\n"
            f"            ? !(({place} <= {limit}) && ({place} >= -{limit}))\n"
            f"            : (({place} > {program.precision.literal(0.0)}) || ({place} < "
            f"{program.precision.literal(0.0)}));"
        )
    return [*lines, "    }"]


# --- The harness

WARNINGS = (
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wfloat-equal",
    "-Wshadow",
    "-Wpedantic",
)
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
"""no -ffast-math and no fused multiply-add, which would change the last digits"""
SMALL_FLAGS = ("-std=c99", "-Os", "-ffp-contract=off", "-fno-math-errno")
"""flags for targets with little memory; a square root is an instruction, without errno"""
TOLERANCE = 1e-5
"""single-precision tolerance for functions of the C library, whose last digit may differ"""


def vector_header(program: Program, every: Sequence[Vectors]) -> str:
    """Return ``NAME_test_vectors.h``."""
    name, real = program.name, program.precision.real
    guard = f"{name.upper()}_TEST_VECTORS_H"
    parts = [
        comment(["Results of the Python laws for inputs at every limit."]),
        f"#ifndef {guard}\n#define {guard}",
    ]
    literal = program.precision.literal
    if program.parameters() and every:
        other = parameter_values(program, "other_parameters", every[0].other, None)
        parts.append(f"static {other}")
    for each in every:
        task = c_name(each.step.task.name)
        parts.append(f"#define VECTORS_{task} {len(each.given)}")
        for what, rows in (("given", each.given), ("after", each.after)):
            lines = [f"    {{{', '.join(map(literal, row))}}}," for row in rows.tolist()]
            width = max(rows.shape[1], 1)
            parts.append(
                f"static const {real} {what}_{task}[VECTORS_{task}][{width}] = {{\n"
                + "\n".join(lines)
                + "\n};"
            )
        if _reads_parameters(each):
            lines = textwrap.wrap(", ".join(map(str, each.which)), 88)
            body = "\n".join(f"    {line}" for line in lines)
            parts.append(f"static const int other_{task}[VECTORS_{task}] = {{\n{body}\n}};")
    return "\n\n".join([*parts, "#endif"]) + "\n"


def _reads_parameters(vectors: Vectors) -> bool:
    return any(short == "par" for _, short in vectors.step.arguments)


def harness(program: Program, every: Sequence[Vectors]) -> str:
    """Return ``NAME_harness.c``, a program that exits with status 1 if a result differs."""
    name = program.name
    what = f"Compares the compiled ECU of {program.model.name} with its test vectors."
    calls = " + ".join(f"differing_{c_name(e.step.task.name)}()" for e in every)
    count = " + ".join(f"VECTORS_{c_name(e.step.task.name)}" for e in every)
    derived = " + differing_derived()" if _derived(program, every) else ""
    breaches = " + ".join(f"breaches_{c_name(e.step.task.name)}()" for e in every)
    parts = [
        *comparison(program, every, what, "#include <stdio.h>"),
        *_derived(program, every),
        f"int main(void)\n{{\n    {name}_Memory memory;\n    int wrong;\n    int breaches;\n\n"
        f"    {name}_ecu_init(&memory);\n    wrong = {calls}{derived};\n"
        f"    breaches = {breaches};\n"
        f'    printf("%d vectors, %d values differ, bits %08lx\\n", {count}, wrong,\n'
        "            (unsigned long)bits);\n"
        '    printf("%d breaches of the contract in README.txt\\n", breaches);\n'
        "    return ((wrong == 0) && (breaches == 0)) ? 0 : 1;\n}",
    ]
    return "\n\n".join(parts) + "\n"


def _derived(program: Program, every: Sequence[Vectors]) -> list[str]:
    """Return the function that compares the derived parameters with Python's numbers."""
    if not program.derived:
        return []
    name = program.name
    sets = [f"{name}_parameters", *(["other_parameters"] if every else [])]
    lines = ["static int differing_derived(void)", "{", "    int wrong = 0;", ""]
    for each in sets:
        lines.append(f"    {name}_Parameters made_{each} = {each};")
    for each in sets:
        lines.append(f"    {name}_ecu_derive(&made_{each});")
        lines += [
            f"    wrong += is_same(made_{each}.{number.place}, {each}.{number.place}) ? 0 : 1;"
            for number in program.derived
        ]
    return ["\n".join([*lines, "    return wrong;", "}"])]


def comparison(program: Program, every: Sequence[Vectors], what: str, include: str) -> list[str]:
    """Return the first part of a harness: one function per task that compares it with its vectors.

    Parameters
    ----------
    what
        Comment at the top.
    include
        ``#include`` line for the harness's output.
    """
    name = program.name
    return [
        comment([what]),
        f"#include <math.h>\n#include <stdint.h>\n{include}\n#include <string.h>\n"
        f'#include "{name}_ecu.h"\n#include "{name}_test_vectors.h"',
        _same(program),
        _mixed(program),
        *(_compared(program, each) for each in every),
        *trespassing(program, every),
    ]


def _same(program: Program) -> str:
    real, literal = program.precision.real, program.precision.literal
    head = f"static int is_same({real} a, {real} b)\n{{\n"
    if program.inexact:
        width = literal(TOLERANCE)
        zero = literal(0.0)
        return (
            f"{head}    const {real} size = (b < {zero}) ? -b : b;\n"
            f"    const {real} apart = (a < b) ? (b - a) : (a - b);\n"
            f"    return apart <= {width} * size + {width} * {width};\n}}"
        )
    return f"{head}    return (a <= b) && (a >= b);\n}}"


def _mixed(program: Program) -> str:
    real = program.precision.real
    return f"""/* A hash of all results (FNV-1a), equal if the results are bit-identical. */
static uint32_t bits = 2166136261u;

static void mix({real} value)
{{
    unsigned char bytes[sizeof value];

    memcpy(bytes, &value, sizeof value);
    for (unsigned int n = 0; n < sizeof value; ++n) {{
        bits = (bits ^ bytes[n]) * 16777619u;
    }}
}}"""


def _compared(program: Program, vectors: Vectors) -> str:
    task = c_name(vectors.step.task.name)
    lines = [
        f"static int differing_{task}(void)",
        "{",
        "    int wrong = 0;",
        "",
        f"    for (int k = 0; k < VECTORS_{task}; ++k) {{",
    ]
    lines += [*prepared(program, vectors), f"        {stepped(vectors)}"]
    for at, field in enumerate(vectors.kept):
        place = f"memory.{c_name(field)}"
        lines.append(f"        wrong += is_same({place}, after_{task}[k][{at}]) ? 0 : 1;")
        lines.append(f"        mix({place});")
    return "\n".join([*lines, "    }", "    return wrong;", "}"])


def makefile(program: Program, has_io: bool) -> str:
    """Return a Makefile whose ``make check`` compares the compiled ECU with the vectors."""
    name = program.name
    parts = ["ecu", *(["io"] if has_io else []), "parameters", "harness"]
    objects = " ".join(f"{name}_{part}.o" for part in parts)
    library = " -lm" if program.libraries else ""
    return (
        "# Use any C99 compiler, without fused multiply-add and fast math.\n"
        "CC = gcc\n"
        f"CFLAGS = {' '.join(FLAGS)} {' '.join(WARNINGS)}\n"
        f"OBJECTS = {objects}\n\n"
        f"{name}_harness: $(OBJECTS)\n\t$(CC) $(CFLAGS) -o $@ $(OBJECTS){library}\n\n"
        f"%.o: %.c $(wildcard *.h)\n\t$(CC) $(CFLAGS) -c -o $@ $<\n\n"
        f"check: {name}_harness\n\t./{name}_harness\n\n"
        f"clean:\n\trm -f $(OBJECTS) {name}_harness\n\n.PHONY: check clean\n"
    )
