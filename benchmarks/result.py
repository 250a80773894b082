"""One figure of the benchmark, and the machine on which it was measured."""

from __future__ import annotations

import os
import platform
import subprocess
from dataclasses import dataclass
from pathlib import Path

import bywire
from bywire.core.brake import error_with_line
from bywire.core.errors import BywireError
from bywire.simulation.compiler import find_compiler

_SOURCES = (str(Path(__file__).parent), str(Path(bywire.__file__).parent))
_VECTOR_BITS = (("avx512f", 512), ("avx2", 256), ("asimd", 128), ("sse2", 128))


@dataclass(frozen=True)
class Result:
    """A measured figure.

    Parameters
    ----------
    id
        Name, for example ``"single.hand_c"``.
    value, unit
        Measured value, None if it could not be measured.
    goal
        Goal as text, empty without a goal.
    holds
        Whether the figure meets its goal, None without a goal or a value.
    note
        Method of measurement, or the reason for a missing value.
    is_failed
        Whether the measurement failed. The note is then the reason.
    """

    id: str
    value: float | None
    unit: str
    goal: str = ""
    holds: bool | None = None
    note: str = ""
    is_failed: bool = False


def failed(name: str, error: Exception, unit: str = "1", goal: str = "") -> Result:
    """Row of a failed measurement, with the last output line of a process or the error text."""
    if isinstance(error, subprocess.CalledProcessError):
        output = error.stderr or ""
        text = output if isinstance(output, str) else output.decode(errors="replace")
        last = (text.strip().splitlines() or ["no message"])[-1]
        reason = f"exit status {error.returncode}: {last}"
    else:
        is_ours = isinstance(error, BywireError)
        reason = str(error) if is_ours else error_with_line(error, *_SOURCES)
    return Result(name, None, unit, goal, None, reason, is_failed=True)


def at_most(name: str, value: float, limit: float, unit: str, note: str) -> Result:
    """Return a figure with an upper limit as its goal."""
    return Result(name, value, unit, f"<= {limit:g}", value <= limit, note)


def at_least(name: str, value: float, limit: float, unit: str, note: str) -> Result:
    """Return a figure with a lower limit as its goal."""
    return Result(name, value, unit, f">= {limit:g}", value >= limit, note)


def vector_doubles() -> int:
    """Return the number of doubles in a vector register of this processor."""
    flags = _cpu_flags()
    return next((bits // 64 for flag, bits in _VECTOR_BITS if flag in flags), 2)


def machine() -> dict[str, object]:
    """Return what the figures depend on: processor, cores, vector width, compiler, load."""
    compiler = find_compiler()
    return {
        "processor": _cpu_name(),
        "cores": os.cpu_count(),
        "vector_doubles": vector_doubles(),
        "compiler": compiler.label if compiler else None,
        "python": platform.python_version(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }


def _cpu_flags() -> set[str]:
    lines = _cpu_lines("flags") or _cpu_lines("Features")
    return set(lines.split())


def _cpu_name() -> str:
    return _cpu_lines("model name") or platform.processor() or platform.machine()


def _cpu_lines(key: str) -> str:
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return ""
    for line in text.splitlines():
        name, _, value = line.partition(":")
        if name.strip() == key:
            return value.strip()
    return ""
