"""Processors on which an exported ECU is tried, and the tools for them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bywire.core.child_process import find_program

CROSS = "arm-none-eabi-gcc"
EMULATOR = "qemu-system-arm"
INSTALL = "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"
HERE = Path(__file__).parent
RUNTIME = ("startup.c", "target.h", "target.ld")
"""files of this folder that run a harness on a Cortex-M"""


@dataclass(frozen=True)
class Target:
    """A processor.

    Parameters
    ----------
    name
        What users call it.
    flags
        For the compiler.
    machine
        Board of the emulator.
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
    """Return what is missing for targets, and how it is installed; empty where nothing is."""
    absent = [name for name in (CROSS, EMULATOR) if find_program(name) is None]
    if not absent:
        return ""
    return f"{' and '.join(absent)} not installed ({INSTALL})"
