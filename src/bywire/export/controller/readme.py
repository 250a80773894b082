"""``README.txt`` of an exported ECU."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

from bywire.export.controller.harness import FLAGS
from bywire.export.controller.program import Program


def readme(program: Program, files: Iterable[str], count: int) -> str:
    """Return what a reader of the files has to know."""
    name, real = program.name, program.precision.real
    size = 4 if program.precision.name == "single" else 8
    memory = sum(max(m.length, 1) for m in program.members(program.model.Memory))
    values = sum(max(m.length, 1) for _, m in program.parameters())
    tasks = [
        f"    {step.name}: every {step.task.period:.9g} s" for step in program.steps
    ]
    said = [
        f"The ECU of {program.model.name} in C99, {program.precision.name} precision: it was "
        "translated from the Python of the laws, and is what the bench runs, operation by "
        "operation. Choices of equations are those of the bench; its numbers are parameters.",
        f"Call {name}_ecu_init once, then every task at its period, tasks that are due together "
        "in this order:",
        *tasks,
        _derived(program),
        f"Memory ({memory} numbers of {size} bytes) belongs to the caller; the description for "
        f"calibration tools expects it to be called {name}_memory. Parameters ({values} numbers) "
        f"are constants in {name}_parameters.c. Nothing is allocated, nothing calls itself, and "
        "there is no state beside the memory.",
        _plant(program),
        f"Compile with {' '.join(FLAGS)} or the like: fast mathematics and fused products change "
        "the last digits. 'make check' compares the compiled ECU with "
        f"{count} vectors of each task, which Python computed.",
        _exactness(program, real),
        "Files: " + ", ".join(files) + ".",
    ]
    return "\n\n".join(
        each if each.startswith("    ") else textwrap.fill(each, 88, break_on_hyphens=False)
        for each in said if each
    ) + "\n"  # fmt: skip


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
