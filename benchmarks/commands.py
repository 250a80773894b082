"""CPU time of whole commands, relative to that of importing the libraries that bywire needs."""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from benchmarks.result import Result, at_most, failed
from bywire.core import child_process
from bywire.core.child_process import python_command
from bywire.simulation.compiler import usable_folder

LIBRARIES = "import numpy, casadi, xarray, pydantic, pint, typer, rich"
"""imports that define the unit L, because absolute times differ by a factor of two by machine"""
_UNIT = python_command("-c", LIBRARIES)
_ANSWERED = (0, 1)  # 1: a requirement is not met, which takes as long
_SLOW = 8.0  # goal above which a command runs only once


@dataclass(frozen=True)
class Command:
    """A command whose CPU time is a figure of the benchmark. Each folder declares its commands.

    Parameters
    ----------
    name
        Name of the figure.
    arguments
        Arguments of ``bywire``. ``{folder}`` is a temporary folder of the benchmark.
    goal
        Maximum CPU time in units of L.
    first
        Arguments of a command that runs once before, for example to record data for a replay.
    """

    name: str
    arguments: tuple[str, ...]
    goal: float
    first: tuple[str, ...] = ()

    @property
    def rounds(self) -> int:
        """Number of measurements. The minimum counts, because disturbances only slow a program."""
        return 1 if self.goal > _SLOW else 7


def measured(commands: Sequence[Command]) -> Iterator[Result]:
    """Measure commands in turn with L, with compiled kernels and Python byte code in place."""
    with tempfile.TemporaryDirectory() as folder:
        for command in commands:
            try:
                yield _measured(command, Path(folder))
            except subprocess.CalledProcessError as error:
                yield failed(command.name, error, "L", f"<= {command.goal:g}")


def _measured(command: Command, folder: Path) -> Result:
    line = _line(command.arguments, folder)
    if command.first:
        processor_seconds_of(_line(command.first, folder))
    processor_seconds_of(_UNIT)
    libraries, taken = [], []
    before = _kernels()
    for _ in range(command.rounds):
        libraries.append(processor_seconds_of(_UNIT))
        taken.append(processor_seconds_of(line))
    if len(taken) == 1 and _kernels() != before:  # it compiled
        taken.append(processor_seconds_of(line))
    libraries.append(processor_seconds_of(_UNIT))
    least, unit = min(taken), min(libraries)
    note = f"{' '.join(command.arguments)}: {least:.3g} s of CPU time; L = {unit:.3g} s; "
    note += f"minimum of {len(taken)} in turn" if len(taken) > 1 else "run once"
    return at_most(command.name, least / unit, command.goal, "L", note.replace(" {folder}", " ..."))


def _line(arguments: Sequence[str], folder: Path) -> list[str]:
    filled = [each.replace("{folder}", str(folder)) for each in arguments]
    return python_command("-m", "bywire.cli", *filled)


def _kernels() -> set[str]:
    return {path.name for path in usable_folder().glob("*.so")}


def seconds_of(
    line: Sequence[str],
    limit: float | None = None,
    changes: Mapping[str, str] = MappingProxyType({}),
) -> float:
    """Return the run time of a process [s], without showing its output.

    Parameters
    ----------
    line
        Command line of a command of bywire, or of another program.
    limit
        Maximum run time [s]. Default: none.
    changes
        Additional environment variables.

    Raises
    ------
    CalledProcessError
        If the process fails.
    TimeoutExpired
        If the process is not finished within its limit. It is killed.
    """
    begin = time.perf_counter()
    done = subprocess.run(
        line,
        env=environment() | dict(changes),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
        timeout=limit,
        check=False,
    )
    seconds = time.perf_counter() - begin
    if done.returncode not in _ANSWERED:
        raise subprocess.CalledProcessError(done.returncode, line, stderr=done.stderr)
    return seconds


def processor_seconds_of(line: Sequence[str]) -> float:
    """Return the CPU time of a process and its children [s]; its run time on Windows.

    Raises
    ------
    CalledProcessError
        If the process fails.
    """
    try:
        import resource
    except ImportError:  # Windows does not add up the times of a process's children
        return seconds_of(line)

    def used() -> float:
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        return ended.ru_utime + ended.ru_stime

    begin = used()
    seconds_of(line)
    return used() - begin


def environment() -> dict[str, str]:
    """Return a user's environment, in which Python saves its byte code."""
    return {k: v for k, v in child_process.environment().items() if k != "PYTHONDONTWRITEBYTECODE"}
