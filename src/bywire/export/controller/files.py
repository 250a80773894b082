"""All files of an ECU in C by name, including A2L, DBC and ``README.txt``."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.core.catalog import Cited
from bywire.core.parameters import Leaf, leaf_fields
from bywire.core.signals import signals_of
from bywire.export.controller import render
from bywire.export.controller.c_text import BEGIN_C, END_C, c_name, comment, wrapped
from bywire.export.controller.contract import INPUT, LARGEST, RESULT, CheckedInput
from bywire.export.controller.harness import FLAGS, harness, makefile, vector_header
from bywire.export.controller.program import Program
from bywire.export.controller.render import c_path, parameter_file
from bywire.export.controller.vectors import Vectors

_FAR = 1e32
"""limit of a quantity without a limit, because some tools reject infinity"""


def a2l(program: Program) -> str:
    """Return the A2L description, with symbol links instead of addresses, which are zero.

    The links refer to the memory and the parameters in ``NAME_instance.c``, which are in RAM.
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
            f'    /begin CHARACTERISTIC {place} "{_a2l_text(member.note)}"\n'
            f"      {shape} {low:.9g} {high:.9g}{size}\n"
            f'      SYMBOL_LINK "{name}_calibration.{place}" 0\n    /end CHARACTERISTIC'
        )
    signals = signals_of(program.model.Memory)
    for member in program.members(program.model.Memory):
        signal = signals[member.name]
        unit = units.setdefault(signal.unit, f"CM_{len(units)}")
        field = c_name(member.name)
        blocks.append(
            f'    /begin MEASUREMENT memory.{field} "{_a2l_text(signal.label)}"\n'
            f"      {kind} {unit} 0 0 {-_FAR:.9g} {_FAR:.9g}\n      ECU_ADDRESS 0x0\n"
            f'      SYMBOL_LINK "{name}_memory.{field}" 0\n    /end MEASUREMENT'
        )
    for step in program.steps:
        unit = units.setdefault("1", f"CM_{len(units)}")
        label = f"status of task {_a2l_text(step.task.name)}"
        blocks.append(
            f'    /begin MEASUREMENT memory.{step.status} "{label}"\n'
            f"      ULONG {unit} 0 0 0 {INPUT | RESULT}\n      ECU_ADDRESS 0x0\n"
            f'      SYMBOL_LINK "{name}_memory.{step.status}" 0\n    /end MEASUREMENT'
        )
    methods = [
        f'    /begin COMPU_METHOD {method} "{text}" IDENTICAL "%12.6" "{text}"\n'
        "    /end COMPU_METHOD"
        for unit, method in units.items()
        for text in (_a2l_text(unit),)
    ]
    body = "\n".join([*methods, *blocks])
    return (
        f'ASAP2_VERSION 1 60\n/begin PROJECT {name} "ECU of {_a2l_text(program.model.name)}"\n'
        f'  /begin MODULE {name}_ecu ""\n'
        '    /begin MOD_COMMON ""\n      BYTE_ORDER MSB_LAST\n    /end MOD_COMMON\n'
        f"    /begin RECORD_LAYOUT RL_VALUE\n      FNC_VALUES 1 {kind} ROW_DIR DIRECT\n"
        f"    /end RECORD_LAYOUT\n{body}\n  /end MODULE\n/end PROJECT\n"
    )


def _a2l_text(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')


# --- ``NAME_instance.c``: memory and parameters in RAM, with the names of the A2L's links


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
            f"{comment(['Parameters for calibration tools to change.'])}\n"
            f"extern {name}_Parameters {name}_calibration;",
            f"{comment(['Parameters for the steps: a copy of the calibration.'])}\n"
            f"extern {name}_Parameters {name}_active;",
        ]
    parts.append(
        f"{comment(['Set memory and parameters to the values of the bench.'])}\n"
        f"void {name}_instance_init(void);"
    )
    if program.parameters():
        said = [
            "Return the number of calibrated parameters that are out of range or NaN. If it is 0,",
            "apply the calibration. Otherwise, the steps keep their parameters.",
        ]
        parts.append(f"{comment(said)}\nuint32_t {name}_instance_apply(void);")
    return "\n\n".join([*parts, END_C, "#endif"]) + "\n"


def instance_source(program: Program) -> str:
    """Return ``NAME_instance.c``."""
    name = program.name
    parts = [
        comment(
            [
                f"An instance of the ECU of {program.model.name}. Omit this file if your program",
                "stores memory and parameters elsewhere.",
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
    said = "Return the number of parameters that are out of range or NaN."
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
    """Return the conditions for a parameter's range; a distant end becomes the largest number."""
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


# --- CAN
# Each memory field and the status of each step is a signed 16-bit signal. A message of 8 bytes
# contains four signals. The lowest count means "not available".

FIRST = 0x100
"""identifier of the first message"""
CYCLE = 10
"""interval between messages [ms]"""
NOT_AVAILABLE = -32768
"""count for a NaN or infinite value, outside the range of every signal"""
_MOST, _IN_A_MESSAGE, _LONGEST = 32767, 4, 32
_ROOM = 10.0  # minimum ratio of full scale to the usual magnitude of a signal


@dataclass(frozen=True)
class CanSignal:
    """A measurement on the bus: memory field, unit, meaning, and value of one count."""

    field: str
    unit: str
    label: str
    factor: float

    @property
    def name(self) -> str:
        """Name on the bus."""
        return c_name(self.field)[:_LONGEST]


def messages(program: Program) -> list[list[CanSignal]]:
    """Return the signals of each message: memory fields in their order, then the statuses."""
    signals = signals_of(program.model.Memory)
    each = [
        CanSignal(member.name, found.unit, found.label, _factor(found.nominal))
        for member in program.members(program.model.Memory)
        for found in (signals[member.name],)
    ]
    each += [
        CanSignal(step.status, "1", f"status of task {step.task.name}", 1.0)
        for step in program.steps
    ]
    return [each[k : k + _IN_A_MESSAGE] for k in range(0, len(each), _IN_A_MESSAGE)]


def _factor(nominal: float) -> float:
    """Return the value of one count, which is 1, 2 or 5 times a power of ten."""
    least = _ROOM * abs(nominal) / _MOST
    power = math.floor(math.log10(least))
    return next(f for f in (float(f"{k}e{power}") for k in (1, 2, 5, 10)) if f >= least)


def dbc(program: Program) -> str:
    """Return the DBC description of the messages."""
    name = c_name(program.name)
    every = list(enumerate(messages(program), FIRST))
    lines = ['VERSION ""', "", "NS_ :", "", "BS_:", "", "BU_: ECU"]
    for number, signals in every:
        lines += ["", f"BO_ {number} {_message(name, number)}: 8 ECU", *_signals(signals)]
    lines += ["", f'CM_ "ECU of {_dbc_text(program.model.name)}: its memory after a tick";']
    lines += [
        f'CM_ SG_ {number} {each.name} "{_dbc_text(each.label)}";'
        for number, signals in every
        for each in signals
    ]
    lines += [
        f'VAL_ {number} {each.name} {NOT_AVAILABLE} "not available" ;'
        for number, signals in every
        for each in signals
    ]
    cycle = '"GenMsgCycleTime"'
    lines += [f"BA_DEF_ BO_ {cycle} INT 0 65535;", f"BA_DEF_DEF_ {cycle} 0;"]
    lines += [f"BA_ {cycle} BO_ {number} {CYCLE};" for number, _ in every]
    return "\n".join(lines) + "\n"


def _signals(signals: Sequence[CanSignal]) -> Iterator[str]:
    for k, each in enumerate(signals):
        low, high = (f"{count * each.factor:.9g}" for count in (-_MOST, _MOST))
        yield (
            f" SG_ {each.name} : {16 * k}|16@1- ({each.factor:.9g},0) [{low}|{high}] "
            f'"{_dbc_text(each.unit)}" Vector__XXX'
        )


def _message(name: str, number: int) -> str:
    ending = f"_{number - FIRST + 1}"
    return name[: _LONGEST - len(ending)] + ending


def _dbc_text(text: str) -> str:
    """Return a text for use in quotation marks, with characters that every DBC reader accepts."""
    plain = text.encode("ascii", "replace").decode()
    return plain.replace("\\", "/").replace('"', "'")


def can_header(program: Program) -> str:
    """Return ``NAME_can.h``."""
    name, count = program.name, len(messages(program))
    guard = f"{name.upper()}_CAN_H"
    fill = [
        "Fill a message; the first message is 0. A value beyond full scale saturates. A NaN or",
        f'infinite value becomes the count {NOT_AVAILABLE}, which means "not available".',
    ]
    return (
        "\n\n".join(
            [
                comment(
                    [f"Messages of {name}.dbc: first identifier, number of messages, and bytes."]
                ),
                f"#ifndef {guard}\n#define {guard}",
                f'#include <stdint.h>\n#include "{name}_ecu.h"',
                BEGIN_C,
                f"#define {name.upper()}_CAN_FIRST {FIRST}u\n"
                f"#define {name.upper()}_CAN_COUNT {count}u",
                comment(fill)
                + f"\nvoid {name}_can_fill(uint32_t message, const {name}_Memory *memory,\n"
                "        uint8_t data[8]);",
                END_C,
                "#endif",
            ]
        )
        + "\n"
    )


def can_source(program: Program) -> str:
    """Return ``NAME_can.c``."""
    name, real, literal = program.name, program.precision.real, program.precision.literal
    most, half = literal(float(_MOST)), literal(0.5)
    kind = np.float32 if program.precision.name == "single" else np.float64
    largest = literal(float(np.finfo(kind).max))
    statuses = {step.status for step in program.steps}
    cases = []
    for number, signals in enumerate(messages(program)):
        lines = [f"    case {number}u:"]
        for k, each in enumerate(signals):
            cast = f"({real})" if each.field in statuses else ""
            value = f"{cast}memory->{c_name(each.field)}, {literal(each.factor)}"
            lines.append(f"        put(counts({value}), &data[{2 * k}]);")
        cases.append("\n".join([*lines, "        break;"]))
    return f"""{comment([f"Bytes of the messages of {name}.dbc."])}

#include "{name}_can.h"

/* Return the rounded count of a value; for NaN, the count for \"not available\". */
static int32_t counts({real} value, {real} factor)
{{
    const {real} wanted = value / factor;
    int32_t result;

    if (!((value >= -{largest}) && (value <= {largest}))) {{
        result = {NOT_AVAILABLE};
    }} else if (wanted >= {most}) {{
        result = {_MOST};
    }} else if (wanted <= -{most}) {{
        result = -{_MOST};
    }} else if (wanted >= {literal(0.0)}) {{
        result = (int32_t)(wanted + {half});
    }} else {{
        result = (int32_t)(wanted - {half});
    }}
    return result;
}}

/* Write 16 bits to a message, low byte first. */
static void put(int32_t count, uint8_t *bytes)
{{
    const uint32_t word = (uint32_t)count;

    bytes[0] = (uint8_t)(word & 0xFFu);
    bytes[1] = (uint8_t)((word >> 8) & 0xFFu);
}}

void {name}_can_fill(uint32_t message, const {name}_Memory *memory, uint8_t data[8])
{{
    for (uint32_t k = 0u; k < 8u; ++k) {{
        data[k] = 0u;
    }}
    switch (message) {{
{chr(10).join(cases)}
    default:
        break;
    }}
}}
"""


# --- All files


def files(
    program: Program,
    memory: Any,
    cited: Mapping[str, Cited],
    every: Sequence[Vectors],
    *,
    bus: bool = False,
) -> dict[str, str]:
    """Return the text of every file.

    Parameters
    ----------
    memory
        Initial memory of the bench.
    cited
        Values of the parameter set with their provenance.
    every
        Test vectors of the tasks.
    bus
        Whether to include descriptions of measurements for a CAN bus.
    """
    name = program.name
    made = {
        f"{name}_ecu.h": render.header(program),
        f"{name}_ops.h": render.operations(program),
        f"{name}_ecu.c": render.source(program),
        f"{name}_parameters.c": parameter_file(program, memory, cited),
    }
    if render.has_io(program):
        made[f"{name}_io.h"] = render.io_header(program)
        made[f"{name}_io.c"] = render.io_source(program)
    made[f"{name}_instance.h"] = instance_header(program)
    made[f"{name}_instance.c"] = instance_source(program)
    made[f"{name}_test_vectors.h"] = vector_header(program, every)
    made[f"{name}_harness.c"] = harness(program, every)
    made["Makefile"] = makefile(program, render.has_io(program))
    made[f"{name}.a2l"] = a2l(program)
    if bus:
        made[f"{name}.dbc"] = dbc(program)
        made[f"{name}_can.h"] = can_header(program)
        made[f"{name}_can.c"] = can_source(program)
    made["README.txt"] = readme(program, sorted([*made, "README.txt"]), len(every[0].given))
    return made


# --- ``README.txt``


def readme(program: Program, files: Iterable[str], count: int) -> str:
    """Return the README of the exported files."""
    name, real = program.name, program.precision.real
    size = 4 if program.precision.name == "single" else 8
    memory = sum(max(m.length, 1) for m in program.members(program.model.Memory))
    values = sum(max(m.length, 1) for _, m in program.parameters())
    tasks = [f"    {step.name}: every {step.task.period:.9g} s" for step in program.steps]
    said = [
        f"The ECU of {program.model.name} in C99, {program.precision.name} precision. bywire "
        "translated it from the laws' Python code. It performs the same operations as the bench. "
        "Choices of equations are fixed as in the bench, and its numbers are parameters.",
        f"Call {name}_ecu_init once, then call each task at its period. If several tasks are due "
        "at the same time, call them in this order:",
        *tasks,
        _derived(program),
        f"The caller owns the memory ({memory} numbers of {size} bytes and a status for each "
        f"task), which contains all states. Parameters ({values} numbers) are constants in "
        f"{name}_parameters.c. The code allocates no memory, and no function is recursive.",
        *_instance(program),
        *_contract(program),
        f"All names in the headers begin with {name}_, so you can link ECUs with different names "
        "into one program, for example this ECU in both precisions. The headers also work in C++.",
        _plant(program),
        f"Compile with {' '.join(FLAGS)} or similar flags, because fast math and fused "
        "multiply-add change the last digits. 'make check' compares the compiled ECU with Python's "
        f"results for {count} test vectors of each task.",
        _exactness(program, real),
        "Files: " + ", ".join(files) + ".",
    ]
    return (
        "\n\n".join(
            each if each.startswith("    ") else textwrap.fill(each, 88, break_on_hyphens=False)
            for each in said
            if each
        )
        + "\n"
    )


def _contract(program: Program) -> list[str]:
    """Return the contract of a step for arbitrary inputs, memory and parameters."""
    name, upper = program.name, program.name.upper()
    ranges = [
        f"    {each.kind}->{c_name(each.field)}: {_range(each)}"
        for each in _inputs(program)
        if math.isfinite(each.low) or math.isfinite(each.high)
    ]
    said = [
        "CONTRACT OF A STEP",
        "Inputs. A step checks the inputs that its task reads. The magnitude of each input must "
        f"be below {LARGEST:g} in its SI unit"
        + (", and these inputs must be in their range:" if ranges else "."),
        *(["\n".join(ranges)] if ranges else []),
        "If an input is not valid (NaN, infinity, out of range), the step computes nothing. The "
        f"memory keeps its values, including the last commands, and memory->status_TASK becomes "
        f"{upper}_STATUS_INPUT ({INPUT}). The next step with valid inputs continues from this "
        "memory. The caller decides how long to hold the commands and how to replace them.",
        "Results. A wrong parameter or corrupted memory can cause a state or a command that is NaN "
        "or exceeds this magnitude after a tick. The step then resets the memory as "
        f"{name}_ecu_init does, and the status becomes {upper}_STATUS_RESULT ({RESULT}). Otherwise "
        "the status is 0.",
    ]
    limits = [
        f"    memory->{c_name(each.field)}: "
        f"{'at most' if each.is_input else 'within plus and minus'} {each.limit.text}"
        for step in program.steps
        for each in step.commands
    ]
    if limits:
        said += [
            "Commands. These commands stay within their limits for any inputs, memory and "
            "parameters. A limit that is negative or NaN is treated as 0:",
            "\n".join(limits),
        ]
    said.append(
        "Parameters. A step does not check them. "
        + (
            f"{name}_instance_apply accepts calibrated parameters only if all of them are "
            "within the ranges in the A2L file. It does not check relations between parameters."
            if program.parameters()
            else ""
        )
    )
    return said


def _inputs(program: Program) -> list[CheckedInput]:
    """Return the inputs of all tasks without duplicates."""
    return list(dict.fromkeys(each for step in program.steps for each in step.inputs))


def _range(each: CheckedInput) -> str:
    if not math.isfinite(each.high):
        return f"at least {each.low:g}"
    return (
        f"at most {each.high:g}"
        if not math.isfinite(each.low)
        else (f"from {each.low:g} to {each.high:g}")
    )


def _instance(program: Program) -> list[str]:
    name = program.name
    if not program.parameters():
        return [f"{name}_instance.c contains {name}_memory, which {name}.a2l refers to."]
    return [
        f"{name}_instance.c is optional. It contains {name}_memory and parameters in RAM. "
        f"Calibration tools change {name}_calibration, which {name}.a2l refers to. The steps use "
        f"{name}_active. Call {name}_instance_init instead of {name}_ecu_init. To apply the "
        f"calibration, call {name}_instance_apply between two steps."
    ]


def _derived(program: Program) -> str:
    if not program.derived:
        return ""
    return (
        "The parameter structure also contains values derived from the parameters. After changing "
        f"parameters in place, call {program.name}_ecu_derive before the next step."
    )


def _plant(program: Program) -> str:
    names = [each.name for each in program.functions if each.is_plant]
    if not names:
        return ""
    return (
        f"{program.name}_io.c contains the plant interface of each tick ({', '.join(names)}): "
        "sensors and converters as simulated by the bench, and power-stage limits. On a target, "
        "the hardware replaces this file."
    )


def _exactness(program: Program, real: str) -> str:
    free = program.inexact
    said = "Calls of the C library: " + (", ".join(program.libraries) or "none") + ". "
    if free:
        return said + (
            f"The last digit of {', '.join(free)} differs between libraries. Results are "
            "bit-identical to Python's if both use the same library, and otherwise agree to within "
            "rounding."
        )
    return said + (
        f"With IEEE 754 arithmetic of type {real}, all results are bit-identical to Python's on "
        "every target."
    )
