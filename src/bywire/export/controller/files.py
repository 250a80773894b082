"""All files of an ECU in C, by name, with the ``README.txt`` that explains them."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from bywire.core.catalog import Cited
from bywire.export.controller import render
from bywire.export.controller.c_text import c_name
from bywire.export.controller.contract import INPUT, LARGEST, RESULT, CheckedInput
from bywire.export.controller.harness import FLAGS, harness, makefile, vector_header
from bywire.export.controller.program import Program
from bywire.export.controller.render import parameter_file
from bywire.export.controller.tool_files import (
    a2l,
    can_header,
    can_source,
    dbc,
    instance_header,
    instance_source,
)
from bywire.export.controller.vectors import Vectors


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
        Whether to describe measurements for a CAN bus, too.
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
        f"The ECU of {program.model.name} in C99, {program.precision.name} precision: it was "
        "translated from the Python of the laws and equals what the bench runs, operation by "
        "operation. Choices of equations are fixed as in the bench; its numbers are parameters.",
        f"Call {name}_ecu_init once, then every task at its period; call tasks due together "
        "in this order:",
        *tasks,
        _derived(program),
        f"Memory ({memory} numbers of {size} bytes and a status for each task) belongs to the "
        f"caller. Parameters ({values} numbers) are constants in {name}_parameters.c. Nothing is "
        "allocated, no function is recursive, and the memory contains all states.",
        *_instance(program),
        *_contract(program),
        f"All names in the headers begin with {name}_, and the headers also work in C++: ECUs with "
        "other names link into one program, for instance this ECU in both precisions under two "
        "names.",
        _plant(program),
        f"Compile with {' '.join(FLAGS)} or similar flags: fast math and fused multiply-add change "
        "the last digits. 'make check' compares the compiled ECU with "
        f"{count} vectors of each task, which Python computed.",
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
        f"Inputs. A step checks the inputs that its task reads. Each must be a number below "
        f"{LARGEST:g} in magnitude, in its SI unit"
        + (", and within its range:" if ranges else "."),
        *(["\n".join(ranges)] if ranges else []),
        "If an input is not valid (NaN, infinity, out of range), the step computes nothing. The "
        f"memory keeps its values, including the last commands, and memory->status_TASK becomes "
        f"{upper}_STATUS_INPUT ({INPUT}). The next step with valid inputs continues from there. "
        "The caller decides how long to hold commands, and what replaces them.",
        "Results. If a state or a command is not a number below that magnitude after a tick, due "
        "to a wrong parameter or corrupted memory, the step resets the memory as in "
        f"{name}_ecu_init, and the status becomes {upper}_STATUS_RESULT ({RESULT}). Otherwise the "
        "status is 0.",
    ]
    limits = [
        f"    memory->{c_name(each.field)}: "
        f"{'at most' if each.is_input else 'within plus and minus'} {each.limit.text}"
        for step in program.steps
        for each in step.commands
    ]
    if limits:
        said += [
            "Commands. For any inputs, memory and parameters, these commands stay within "
            "their limits. A limit that is negative or NaN counts as 0:",
            "\n".join(limits),
        ]
    said.append(
        "Parameters. A step does not check them. "
        + (
            f"{name}_instance_apply accepts calibrated parameters only if all of them are "
            "within the ranges of the A2L file. It does not check relations between parameters."
            if program.parameters()
            else ""
        )
    )
    return said


def _inputs(program: Program) -> list[CheckedInput]:
    """Return the inputs of all tasks, each once."""
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
        return [f"{name}_instance.c contains {name}_memory, to which {name}.a2l links."]
    return [
        f"{name}_instance.c is optional. It contains {name}_memory, and parameters in RAM: a "
        f"calibration tool changes {name}_calibration, to which {name}.a2l links, and the steps "
        f"use {name}_active. Call {name}_instance_init instead of {name}_ecu_init, and "
        f"{name}_instance_apply between two steps to apply the calibration."
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
        f"{program.name}_io.c contains the plant's side of the ticks ({', '.join(names)}): "
        "sensors and converters as simulated by the bench, and limits of the power stage. On "
        "a target the hardware takes its place."
    )


def _exactness(program: Program, real: str) -> str:
    free = program.inexact
    said = "Calls of the C library: " + (", ".join(program.libraries) or "none") + ". "
    if free:
        return said + (
            f"The last digit of {', '.join(free)} differs between libraries: results equal "
            "Python's in every bit if both use the same library, otherwise within rounding."
        )
    return said + (
        f"With IEEE 754 arithmetic of {real} all results are equal to Python's in every bit, on "
        "every target."
    )
