"""``NAME.a2l`` for calibration tools (ASAP2 1.6), and the C of the memory that it describes."""

from __future__ import annotations

import math

import numpy as np

from bywire.core.parameters import Leaf, leaf_fields
from bywire.core.signals import signals_of
from bywire.export.controller.c_text import BEGIN_C, END_C, c_name, comment, wrapped
from bywire.export.controller.contract import INPUT, RESULT
from bywire.export.controller.program import Program
from bywire.export.controller.render import c_path

_FAR = 1e32
"""limit of what has none: some tools refuse infinity"""


def a2l(program: Program) -> str:
    """Return the description; addresses are zero, and found by symbol links in the linked file.

    The links lead to the memory and the parameters of ``NAME_instance.c``, which are in RAM.
    """
    name = program.name
    kind = "FLOAT32_IEEE" if program.precision.name == "single" else "FLOAT64_IEEE"
    blocks: list[str] = []
    units: dict[str, str] = {}
    leaves = leaf_fields(type(program.par))
    for dotted, member in program.parameters():
        leaf = leaves[dotted]
        low, high = (max(min(v, _FAR), -_FAR) for v in (leaf.low, leaf.high))
        unit = units.setdefault(leaf.unit.symbol, f"CM_{len(units)}")
        shape = f"{'VAL_BLK' if member.length else 'VALUE'} 0x0 RL_VALUE 0 {unit}"
        size = f"\n      NUMBER {member.length}" if member.length else ""
        place = ".".join(c_name(part) for part in dotted.split("."))
        blocks.append(
            f'    /begin CHARACTERISTIC {place} "{_text(member.note)}"\n'
            f"      {shape} {low:.9g} {high:.9g}{size}\n"
            f'      SYMBOL_LINK "{name}_calibration.{place}" 0\n    /end CHARACTERISTIC'
        )
    signals = signals_of(program.model.Memory)
    for member in program.members(program.model.Memory):
        signal = signals[member.name]
        unit = units.setdefault(signal.unit, f"CM_{len(units)}")
        field = c_name(member.name)
        blocks.append(
            f'    /begin MEASUREMENT memory.{field} "{_text(signal.label)}"\n'
            f"      {kind} {unit} 0 0 {-_FAR:.9g} {_FAR:.9g}\n      ECU_ADDRESS 0x0\n"
            f'      SYMBOL_LINK "{name}_memory.{field}" 0\n    /end MEASUREMENT'
        )
    for step in program.steps:
        unit = units.setdefault("1", f"CM_{len(units)}")
        label = f"status of task {_text(step.task.name)}"
        blocks.append(
            f'    /begin MEASUREMENT memory.{step.status} "{label}"\n'
            f"      ULONG {unit} 0 0 0 {INPUT | RESULT}\n      ECU_ADDRESS 0x0\n"
            f'      SYMBOL_LINK "{name}_memory.{step.status}" 0\n    /end MEASUREMENT'
        )
    methods = [
        f'    /begin COMPU_METHOD {method} "{_text(unit)}" IDENTICAL "%12.6" "{_text(unit)}"\n'
        "    /end COMPU_METHOD"
        for unit, method in units.items()
    ]
    body = "\n".join([*methods, *blocks])
    return (
        f'ASAP2_VERSION 1 60\n/begin PROJECT {name} "ECU of {_text(program.model.name)}"\n'
        f'  /begin MODULE {name}_ecu ""\n'
        '    /begin MOD_COMMON ""\n      BYTE_ORDER MSB_LAST\n    /end MOD_COMMON\n'
        f"    /begin RECORD_LAYOUT RL_VALUE\n      FNC_VALUES 1 {kind} ROW_DIR DIRECT\n"
        f"    /end RECORD_LAYOUT\n{body}\n  /end MODULE\n/end PROJECT\n"
    )


def _text(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')


# --- ``NAME_instance.c``: memory and parameters in RAM, under the names that the A2L links to


def instance_header(program: Program) -> str:
    """Return ``NAME_instance.h``."""
    name = program.name
    parts = [
        comment([f"An instance of the ECU of {program.model.name}: memory and parameters in RAM."]),
        f"#ifndef {name.upper()}_INSTANCE_H\n#define {name.upper()}_INSTANCE_H",
        f'#include <stdint.h>\n#include "{name}_ecu.h"',
        BEGIN_C,
        f"{comment(['Memory for the steps.'])}\nextern {name}_Memory {name}_memory;",
    ]
    if program.parameters():
        parts += [
            f"{comment(['Parameters that a calibration tool changes.'])}\n"
            f"extern {name}_Parameters {name}_calibration;",
            f"{comment(['Parameters for the steps, taken over from those.'])}\n"
            f"extern {name}_Parameters {name}_active;",
        ]
    parts.append(
        f"{comment(['Set memory and parameters as the bench has them.'])}\n"
        f"void {name}_instance_init(void);"
    )
    if program.parameters():
        said = [
            "Take over what was calibrated, and return how many of its numbers are outside their",
            "ranges or no numbers. Where there is one, nothing is taken over.",
        ]
        parts.append(f"{comment(said)}\nuint32_t {name}_instance_apply(void);")
    return "\n\n".join([*parts, END_C, "#endif"]) + "\n"


def instance_source(program: Program) -> str:
    """Return ``NAME_instance.c``."""
    name = program.name
    parts = [
        comment(
            [
                f"An instance of the ECU of {program.model.name}; leave this file out if memory",
                "and parameters have a place of their own in your program.",
            ]
        ),
        f'#include "{name}_instance.h"',
        f"{name}_Memory {name}_memory;",
    ]
    init = [f"    {name}_ecu_init(&{name}_memory);"]
    if program.parameters():
        parts[-1] += f"\n{name}_Parameters {name}_calibration;\n{name}_Parameters {name}_active;"
        parts.append(_outside(program))
        init += [
            f"    {name}_calibration = {name}_parameters;",
            f"    {name}_active = {name}_parameters;",
        ]
    parts.append("\n".join([f"void {name}_instance_init(void)", "{", *init, "}"]))
    if program.parameters():
        derive = f"        {name}_ecu_derive(&{name}_active);\n" if program.derived else ""
        parts.append(
            f"uint32_t {name}_instance_apply(void)\n{{\n"
            f"    const uint32_t count = outside(&{name}_calibration);\n\n"
            "    if (count == 0u) {\n"
            f"        {name}_active = {name}_calibration;\n{derive}    }}\n"
            "    return count;\n}"
        )
    return "\n\n".join(parts) + "\n"


def _outside(program: Program) -> str:
    """Return the function that counts the parameters outside their ranges."""
    leaves = leaf_fields(type(program.par))
    lines = []
    for dotted, member in program.parameters():
        for k in range(member.length or 1):
            place = f"par->{c_path(dotted)}{f'[{k}]' if member.length else ''}"
            checks = " && ".join(_within(program, place, leaves[dotted]))
            lines.append(wrapped(f"count += ({checks}) ? 0u : 1u;", "    "))
    said = "Return how many parameters are outside their ranges, or no numbers."
    return "\n".join(
        [
            comment([said]),
            f"static uint32_t outside(const {program.name}_Parameters *par)",
            "{",
            "    uint32_t count = 0u;",
            "",
            *lines,
            "    return count;",
            "}",
        ]
    )


def _within(program: Program, place: str, leaf: Leaf) -> list[str]:
    """Return the conditions of a parameter's range; an end that is far away is the last number."""
    kind = np.float32 if program.precision.name == "single" else np.float64
    last = float(np.finfo(kind).max)
    low = f">{'' if leaf.low_open else '='}", leaf.low
    high = f"<{'' if leaf.high_open else '='}", leaf.high
    found = []
    for (sign, end), far in ((low, -last), (high, last)):
        is_far = not math.isfinite(end) or abs(end) >= last
        number = program.precision.literal(far if is_far else end)
        found.append(f"({place} {sign[0] + '=' if is_far else sign} {number})")
    return found
