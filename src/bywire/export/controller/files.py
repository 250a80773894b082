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
        With which the bench begins.
    cited
        Values of the parameter set with their provenance.
    every
        Test vectors of the tasks.
    bus
        Whether measurements are described for a CAN bus, too.
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
    """Return what a reader of the files has to know."""
    name, real = program.name, program.precision.real
    size = 4 if program.precision.name == "single" else 8
    memory = sum(max(m.length, 1) for m in program.members(program.model.Memory))
    values = sum(max(m.length, 1) for _, m in program.parameters())
    tasks = [f"    {step.name}: every {step.task.period:.9g} s" for step in program.steps]
    said = [
        f"The ECU of {program.model.name} in C99, {program.precision.name} precision: it was "
        "translated from the Python of the laws, and is what the bench runs, operation by "
        "operation. Choices of equations are those of the bench; its numbers are parameters.",
        f"Call {name}_ecu_init once, then every task at its period, tasks that are due together "
        "in this order:",
        *tasks,
        _derived(program),
        f"Memory ({memory} numbers of {size} bytes and a status for each task) belongs to the "
        f"caller. Parameters ({values} numbers) are constants in {name}_parameters.c. Nothing is "
        "allocated, nothing calls itself, and there is no state beside the memory.",
        *_instance(program),
        *_contract(program),
        f"Everything that a header shows begins with {name}_, and headers serve C++ too: ECUs of "
        "other names, and this one in the other precision under another name, link into one "
        "program.",
        _plant(program),
        f"Compile with {' '.join(FLAGS)} or the like: fast mathematics and fused products change "
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
    """Return what a step makes of inputs, memory and parameters, whatever they are."""
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
        "If an input is refused (NaN, infinity, out of range), the step computes nothing. The "
        f"memory stays as it was, with the last commands, and memory->status_TASK becomes "
        f"{upper}_STATUS_INPUT ({INPUT}). The next step with valid inputs goes on from there. How "
        "long commands may be held, and what replaces them, is the caller's decision.",
        "Results. If a state or a command is no number below that magnitude after a tick, because "
        "of a wrong parameter or a corrupted memory, the memory begins anew as after "
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
            "Commands. Whatever inputs, memory and parameters are, these commands stay within "
            "their limits; a limit that is negative or no number counts as 0:",
            "\n".join(limits),
        ]
    said.append(
        "Parameters. A step does not check them. "
        + (
            f"{name}_instance_apply takes calibrated parameters over only if all of them are "
            "within the ranges of the A2L; that some belong together is not checked."
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
        return [f"{name}_instance.c holds {name}_memory, to which {name}.a2l links."]
    return [
        f"{name}_instance.c is optional. It holds {name}_memory, and parameters in RAM: a "
        f"calibration tool changes {name}_calibration, to which {name}.a2l links, and steps are "
        f"given {name}_active. Call {name}_instance_init in place of {name}_ecu_init, and "
        f"{name}_instance_apply between two steps to take over what was calibrated."
    ]


def _derived(program: Program) -> str:
    if not program.derived:
        return ""
    return (
        "Beside the parameters stands what follows from them alone. Where parameters are changed "
        f"in place, call {program.name}_ecu_derive before the next step."
    )


def _plant(program: Program) -> str:
    names = [each.name for each in program.functions if each.is_plant]
    if not names:
        return ""
    return (
        f"{program.name}_io.c holds what is the plant's side of the ticks ({', '.join(names)}): "
        "sensors and converters as the bench simulates them, and limits of the power stage. On "
        "a target the hardware takes its place."
    )


def _exactness(program: Program, real: str) -> str:
    free = program.inexact
    said = "Of the C library it calls " + (", ".join(program.libraries) or "nothing") + ". "
    if free:
        return said + (
            f"The last digit of {', '.join(free)} differs between libraries: results are equal to "
            "Python's in every bit where both use one library, and within rounding elsewhere."
        )
    return said + (
        f"With IEEE 754 arithmetic of {real} all results are equal to Python's in every bit, on "
        "every target."
    )
