"""``NAME.a2l``: parameters and measurements of an ECU for calibration tools (ASAP2 1.6)."""

from __future__ import annotations

from bywire.core.parameters import leaf_fields
from bywire.core.signals import signals_of
from bywire.export.controller.c_text import c_name
from bywire.export.controller.contract import INPUT, RESULT
from bywire.export.controller.program import Program

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
