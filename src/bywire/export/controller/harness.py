"""Test vectors as C, and a program that compares the compiled ECU with them."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from bywire.export.controller.c_text import c_name, comment
from bywire.export.controller.parameter_file import parameter_values
from bywire.export.controller.program import Program
from bywire.export.controller.trespassing import prepared, stepped, trespassing
from bywire.export.controller.vectors import Vectors

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
"""without -ffast-math and its like, and without fused products: else the last digits differ"""
SMALL_FLAGS = ("-std=c99", "-Os", "-ffp-contract=off", "-fno-math-errno")
"""for targets whose memory is small; square roots are instructions, without the library's errno"""
TOLERANCE = 1e-5
"""of single precision where functions of the C library are called, whose last digit is free"""


def vector_header(program: Program, every: Sequence[Vectors]) -> str:
    """Return ``NAME_test_vectors.h``."""
    name, real = program.name, program.precision.real
    guard = f"{name.upper()}_TEST_VECTORS_H"
    parts = [
        comment(["What the Python of the laws makes of inputs that reach every limit."]),
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
    """Return ``NAME_harness.c``: exit status 1 where a vector differs."""
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
    """Return the function that compares what follows from parameters with Python's numbers."""
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
    """Return what a harness begins with: a function per task that compares it with its vectors.

    Parameters
    ----------
    what
        Comment at the top.
    include
        What it says its results with.
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
    return f"""/* A number for all results (FNV-1a): equal where they are equal in every bit. */
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
    """Return a Makefile: ``make check`` compares with the vectors."""
    name = program.name
    parts = ["ecu", *(["io"] if has_io else []), "parameters", "harness"]
    objects = " ".join(f"{name}_{part}.o" for part in parts)
    library = " -lm" if program.libraries else ""
    return (
        "# Any compiler of C99 serves; without fused products and fast mathematics.\n"
        "CC = gcc\n"
        f"CFLAGS = {' '.join(FLAGS)} {' '.join(WARNINGS)}\n"
        f"OBJECTS = {objects}\n\n"
        f"{name}_harness: $(OBJECTS)\n\t$(CC) $(CFLAGS) -o $@ $(OBJECTS){library}\n\n"
        f"%.o: %.c $(wildcard *.h)\n\t$(CC) $(CFLAGS) -c -o $@ $<\n\n"
        f"check: {name}_harness\n\t./{name}_harness\n\n"
        f"clean:\n\trm -f $(OBJECTS) {name}_harness\n\n.PHONY: check clean\n"
    )
