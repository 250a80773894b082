"""``NAME.dbc``, and the C that fills its messages: measurements of an ECU for a CAN bus.

Every field of the memory is a signal of 16 bits with a sign, four to a message of 8 bytes, and
so is the status of every step. The lowest count says that there is no value.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from bywire.core.signals import signals_of
from bywire.export.controller.c_text import BEGIN_C, END_C, c_name, comment
from bywire.export.controller.program import Program

FIRST = 0x100
"""identifier of the first message"""
CYCLE = 10
"""interval between messages [ms]"""
NOT_AVAILABLE = -32768
"""count of a value that is no number, or infinite: outside the range of every signal"""
_MOST, _IN_A_MESSAGE, _LONGEST = 32767, 4, 32
_ROOM = 10.0  # full scale over the usual magnitude of a signal, at least


@dataclass(frozen=True)
class CanSignal:
    """A measurement on the bus: its field of the memory, unit, meaning, and value of one count."""

    field: str
    unit: str
    label: str
    factor: float

    @property
    def name(self) -> str:
        """What the bus calls it."""
        return c_name(self.field)[:_LONGEST]


def messages(program: Program) -> list[list[CanSignal]]:
    """Return the signals of every message, in the order of the memory; then the statuses."""
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
    """Return the value of a count: 1, 2 or 5 times a power of ten."""
    least = _ROOM * abs(nominal) / _MOST
    power = math.floor(math.log10(least))
    return next(f for f in (float(f"{k}e{power}") for k in (1, 2, 5, 10)) if f >= least)


def dbc(program: Program) -> str:
    """Return the description of the messages."""
    name = c_name(program.name)
    every = list(enumerate(messages(program), FIRST))
    lines = ['VERSION ""', "", "NS_ :", "", "BS_:", "", "BU_: ECU"]
    for number, signals in every:
        lines += ["", f"BO_ {number} {_message(name, number)}: 8 ECU", *_signals(signals)]
    lines += ["", f'CM_ "ECU of {_text(program.model.name)}: its memory behind a tick";']
    lines += [
        f'CM_ SG_ {number} {each.name} "{_text(each.label)}";'
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
            f'"{_text(each.unit)}" Vector__XXX'
        )


def _message(name: str, number: int) -> str:
    ending = f"_{number - FIRST + 1}"
    return name[: _LONGEST - len(ending)] + ending


def _text(text: str) -> str:
    """Return a text for quotation marks, in the characters that every reader of DBC has."""
    plain = text.encode("ascii", "replace").decode()
    return plain.replace("\\", "/").replace('"', "'")


def can_header(program: Program) -> str:
    """Return ``NAME_can.h``."""
    name, count = program.name, len(messages(program))
    guard = f"{name.upper()}_CAN_H"
    fill = [
        "Fill a message, counted from 0. A value beyond full scale stays at it; one that",
        f"is no number, or infinite, becomes the count {NOT_AVAILABLE}: not available.",
    ]
    return (
        "\n\n".join(
            [
                comment(
                    [f"Messages of {name}.dbc: their first identifier and number, and their bytes."]
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

/* Return the counts of a value, to the nearest one; of none, that which says so. */
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

/* Put 16 bits into a message, the lower ones first. */
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
