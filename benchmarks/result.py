"""One figure of the benchmark, and the machine it was measured on."""

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
        Name, for instance ``"single.hand_c"``.
    value, unit
        What was measured; None where it could not be.
    goal
        The goal as text; empty where there is none.
    holds
        Whether the goal is met; None where there is none or nothing was measured.
    note
        How it was measured, or why not.
    is_failed
        Whether its measurement failed, so that the note is the reason.
    """

    id: str
    value: float | None
    unit: str
    goal: str = ""
    holds: bool | None = None
    note: str = ""
    is_failed: bool = False


def failed(name: str, error: Exception, unit: str = "1", goal: str = "") -> Result:
    """Row of a measurement that failed, with the reason: what a process said last, or the error."""
    if isinstance(error, subprocess.CalledProcessError):
        said = error.stderr or ""
        text = said if isinstance(said, str) else said.decode(errors="replace")
        last = (text.strip().splitlines() or ["no message"])[-1]
        reason = f"exit status {error.returncode}: {last}"
    else:
        is_ours = isinstance(error, BywireError)
        reason = str(error) if is_ours else error_with_line(error, *_SOURCES)
    return Result(name, None, unit, goal, None, reason, is_failed=True)


def at_most(name: str, value: float, limit: float, unit: str, note: str) -> Result:
    """Return a figure that shall not exceed a limit."""
    return Result(name, value, unit, f"<= {limit:g}", value <= limit, note)


def at_least(name: str, value: float, limit: float, unit: str, note: str) -> Result:
    """Return a figure that shall reach a limit."""
    return Result(name, value, unit, f">= {limit:g}", value >= limit, note)


def vector_doubles() -> int:
    """Return how many doubles a vector of this processor holds."""
    flags = _cpu_flags()
    return next((bits // 64 for flag, bits in _VECTOR_BITS if flag in flags), 2)


def machine() -> dict[str, object]:
    """Return what figures depend on: processor, cores, vector width, compiler, load."""
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
