"""Trials of an exported ECU on a processor: compilation, a run of its vectors, measurement."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bywire.core.child_process import find_program, run_program
from bywire.core.errors import CompilerError
from bywire.export.controller.c_text import c_name
from bywire.export.controller.harness import FLAGS, SMALL_FLAGS, comparison, prepared, stepped
from bywire.export.controller.program import Program
from bywire.export.controller.vectors import Vectors
from bywire.simulation.compiler import Compiler

CROSS = "arm-none-eabi-gcc"
EMULATOR = "qemu-system-arm"
INSTALL = "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"
HERE = Path(__file__).parent
RUNTIME = ("startup.c", "target.h", "target.ld")
"""files in this folder for a harness on a Cortex-M"""


@dataclass(frozen=True)
class Target:
    """A processor.

    Parameters
    ----------
    name
        Name for users.
    flags
        Compiler flags.
    machine
        Board that the emulator emulates.
    """

    name: str
    flags: tuple[str, ...]
    machine: str


TARGETS = (
    Target("Cortex-M3", ("-mcpu=cortex-m3", "-mthumb", "-mfloat-abi=soft"), "mps2-an385"),
    Target(
        "Cortex-M4F",
        ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"),
        "mps2-an386",
    ),
    Target(
        "Cortex-M7",
        ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16"),
        "mps2-an500",
    ),
)


def missing_tools() -> str:
    """Return the missing tools with an install command; empty if no tool is missing."""
    absent = [name for name in (CROSS, EMULATOR) if find_program(name) is None]
    if not absent:
        return ""
    verb = "is" if len(absent) == 1 else "are"
    return f"{' and '.join(absent)} {verb} not installed (run {INSTALL})"


# --- A harness for a Cortex-M

SAMPLES = 100
"""maximum number of a task's vectors whose instructions are counted"""
_REPEATS = 40


def target_harness(program: Program, every: Sequence[Vectors]) -> str:
    """Return a program that prints the number of different values, then each task's figures."""
    name = program.name
    what = f"Tests the compiled ECU of {program.model.name} on a Cortex-M."
    tasks = [c_name(each.step.task.name) for each in every]
    calls = " + ".join(f"differing_{task}()" for task in tasks)
    breaches = " + ".join(f"breaches_{task}()" for task in tasks)
    measured = "".join(f"    measure_{task}();\n" for task in tasks)
    parts = [
        *comparison(program, every, what, '#include "target.h"'),
        *(_measured(program, each) for each in every),
        f"int main(void)\n{{\n    {name}_Memory memory;\n\n    {name}_ecu_init(&memory);\n"
        f'    say("differ ");\n    say_number((uint32_t)({calls}));\n'
        f'    say("\\nbits ");\n    say_number(bits);\n'
        f'    say("\\nbreaches ");\n    say_number((uint32_t)({breaches}));\n    say("\\n");\n'
        f"{measured}    return 0;\n}}",
    ]
    return "\n\n".join(parts) + "\n"


def _measured(program: Program, vectors: Vectors) -> str:
    task = c_name(vectors.step.task.name)
    set_up = "\n".join(prepared(program, vectors))
    return f"""static void measure_{task}(void)
{{
    uint32_t most = 0u, sum = 0u, count = 0u, depth = 0u;

    for (int k = 0; k < VECTORS_{task}; k += 1 + VECTORS_{task} / {SAMPLES + 1}) {{
{set_up}
        const {program.name}_Memory given = memory;
        uint32_t begin = SYST_CVR;
        for (int n = 0; n < {_REPEATS}; ++n) {{
            memory = given;
            IN_ORDER();
        }}
        const uint32_t without = counted_since(begin);
        begin = SYST_CVR;
        for (int n = 0; n < {_REPEATS}; ++n) {{
            memory = given;
            IN_ORDER();
            {stepped(vectors)}
        }}
        const uint32_t with = counted_since(begin);
        const uint32_t took = (with - without) * INSTRUCTIONS_PER_COUNT / {_REPEATS}u;
        most = (took > most) ? took : most;
        sum += took;
        count += 1u;
        memory = given;
        paint_stack();
        {stepped(vectors)}
        const uint32_t used = stack_used();
        depth = (used > depth) ? used : depth;
    }}
    say("task {task} ");
    say_number(most);
    say(" ");
    say_number((count > 0u) ? sum / count : 0u);
    say(" ");
    say_number(depth);
    say("\\n");
}}"""


# --- Trials

_TIMEOUT = 300.0


@dataclass(frozen=True)
class TaskFigures:
    """Cost of a task: maximum and mean number of instructions, and stack in bytes."""

    instructions: int
    average: int
    stack: int


@dataclass(frozen=True)
class Trial:
    """Result of an ECU for all its test vectors.

    Parameters
    ----------
    target
        Name of the processor; ``host`` for this machine.
    differing
        Number of values that differ from Python's.
    bits
        Hash of all results, which is equal if the results are bit-identical.
    breaches
        Number of violations of a step's contract with invalid inputs and memory of arbitrary bits.
    rom, ram
        Size in bytes of code, constants and parameters including the compiler's library, and of the
        ECU's memory. None on the host.
    """

    target: str
    precision: str
    differing: int
    bits: int
    breaches: int = 0
    rom: int | None = None
    ram: int | None = None
    tasks: Mapping[str, TaskFigures] | None = None


def host_trial(program: Program, folder: Path, compiler: Compiler, scratch: Path) -> Trial:
    """Return the result of the exported ECU on this machine.

    Raises
    ------
    CompilerError
        If the ECU cannot be compiled or run.
    """
    made = scratch / "host"
    _call(
        [
            *compiler.command,
            *FLAGS,
            *map(str, _sources(program, folder)),
            str(folder / f"{program.name}_harness.c"),
            "-o",
            str(made),
            "-lm",
        ],
    )
    said = _call([str(made)], may_fail=True)
    match = re.search(r"(\d+) values differ, bits ([0-9a-f]+)\n(\d+) breaches", said)
    if match is None:
        raise CompilerError(f"the compiled ECU of {program.name} printed {said[:200]!r}")
    return Trial("host", program.precision.name, int(match[1]), int(match[2], 16), int(match[3]))


def target_trial(
    program: Program, every: Sequence[Vectors], folder: Path, target: Target, scratch: Path
) -> Trial:
    """Return the result of the exported ECU on another processor, run by the emulator.

    Raises
    ------
    CompilerError
        If the ECU cannot be compiled or run.
    """
    objects = []
    for source in _sources(program, folder):
        objects.append(str(scratch / f"{source.stem}.o"))
        _call([CROSS, *SMALL_FLAGS, *target.flags, "-c", str(source), "-o", objects[-1]])
    rom, ram = _sizes(program, objects, target, scratch)
    image = _image(program, every, objects, target, folder, scratch)
    said = _call(
        [
            EMULATOR,
            "-machine",
            target.machine,
            "-nographic",
            "-monitor",
            "none",
            "-serial",
            "none",
            "-semihosting-config",
            "enable=on,target=native",
            "-icount",
            "shift=0",
            "-kernel",
            str(image),
        ]
    )
    match = re.search(r"differ (\d+)\nbits (\d+)\nbreaches (\d+)\n", said)
    if match is None:
        raise CompilerError(f"the ECU of {program.name} on {target.name} printed {said[:200]!r}")
    tasks = {
        name: TaskFigures(int(most), int(mean), int(depth))
        for name, most, mean, depth in re.findall(r"task (\w+) (\d+) (\d+) (\d+)", said)
    }
    differing, bits, breaches = map(int, match.groups())
    return Trial(target.name, program.precision.name, differing, bits, breaches, rom, ram, tasks)


def _sizes(
    program: Program, objects: Sequence[str], target: Target, scratch: Path
) -> tuple[int, int]:
    """Return the size of the ECU's read-only and other memory, with the compiler's library."""
    parts = scratch / "parts.elf"
    steps = [f"-Wl,-u,{step.name}" for step in program.steps]
    _call(
        [
            CROSS,
            *target.flags,
            *objects,
            "-nostartfiles",
            "-Wl,--gc-sections",
            *steps,
            f"-Wl,-e,{program.name}_ecu_init",
            "-o",
            str(parts),
            "-lm",
        ]
    )
    said = _call(["arm-none-eabi-size", str(parts)])
    text, data, bss = map(int, said.splitlines()[1].split()[:3])
    return text + data, data + bss + program.memory_size


def _image(
    program: Program,
    every: Sequence[Vectors],
    objects: Sequence[str],
    target: Target,
    folder: Path,
    scratch: Path,
) -> Path:
    """Return a program for the emulator: the ECU, its vectors, and the startup code."""
    for name in RUNTIME:
        shutil.copyfile(HERE / name, scratch / name)
    harness, image = scratch / "target_harness.c", scratch / "target.elf"
    harness.write_text(target_harness(program, every), encoding="utf-8")
    _call(
        [
            CROSS,
            *SMALL_FLAGS,
            *target.flags,
            f"-I{folder}",
            f"-I{scratch}",
            str(harness),
            str(scratch / "startup.c"),
            *objects,
            "-nostartfiles",
            f"-T{scratch / 'target.ld'}",
            "-o",
            str(image),
            "-lm",
        ]
    )
    return image


def _sources(program: Program, folder: Path) -> list[Path]:
    every = [folder / f"{program.name}_{part}.c" for part in ("ecu", "io", "parameters")]
    return [each for each in every if each.exists()]


def _call(command: list[str], may_fail: bool = False) -> str:
    name = Path(command[0]).name
    try:
        done = run_program([find_program(command[0]) or command[0], *command[1:]], _TIMEOUT)
    except subprocess.TimeoutExpired:
        raise CompilerError(
            f"{name} exceeded its limit of {_TIMEOUT:g} s for an exported ECU"
        ) from None
    except OSError as error:
        raise CompilerError(f"{name} did not start ({error.strerror or error})") from None
    if done.returncode != 0 and not may_fail:
        said = "\n".join((done.stderr or done.stdout).splitlines()[:6]) or "nothing"
        raise CompilerError(f"{name} failed on an exported ECU:\n{said}")
    return done.stdout + done.stderr
