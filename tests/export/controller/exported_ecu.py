"""Exports for several tests: structures of all brakes, written and compiled."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bywire
from bywire.export.controller.harness import FLAGS
from bywire.export.controller.vectors import Vectors

STRUCTURES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "pressure, sine dither": ("hard-braking", "dardanelli2010", {}),
    "filter before the dither": (
        "hard-braking",
        "dardanelli2010",
        {"ecu.filter.place": "before-dither", "ecu.dither.waveform": "triangle"},
    ),
    "gains that differ by region": (
        "hard-braking",
        "dardanelli2010-scheduled",
        {"ecu.dither.waveform": "square"},
    ),
    "ideal converter": (
        "hard-braking",
        "dardanelli2010",
        {"adc.law": "ideal", "ecu.dither.waveform": "off"},
    ),
    "pedal": ("pedal-tracking", "dardanelli2010", {}),
    "current": ("friction-ramp", "dardanelli2010", {}),
    "current loop alone": ("current-step", "dardanelli2010", {}),
    "moment and position": ("moment-pulses", "roberts2003", {}),
    "offset by the actuation force": (
        "moment-pulses",
        "roberts2003",
        {"control.offset.law": "scheduled", "encoder.law": "ideal"},
    ),
    "position of two screws": ("position-step", "roberts2003", {}),
    "position of a rig": ("screw-position", "roberts2003", {}),
    "slip by rules": ("straight-stop", "sport600", {"ecu.abs": "rules"}),
    "slip by PI": ("straight-stop", "sport600", {"ecu.abs": "pi"}),
    "mixed slip, fixed gain": (
        "straight-stop",
        "sport600",
        {
            "ecu.abs": "pi",
            "ecu.mix.alpha": 0.5,
            "ecu.front_slip.schedule": "fixed",
            "ecu.vehicle_speed.law": "accelerometer",
            "ecu.wheel_speed.law": "difference",
        },
    ),
    "known speeds, no lift control": (
        "straight-stop",
        "sport600",
        {"ecu.sees": "known", "ecu.lift": "off", "ecu.front_slip.eager": 10.0},
    ),
    "slip over a moment, in a hurry": ("corner-panic", "roberts2003-corner", {}),
}
"""structural choices of all brakes: experiment, parameter set, overrides"""

BRAKES = ("pressure, sine dither", "moment and position", "slip by rules")


def bits_of(precision: str, every: Sequence[Vectors]) -> str:
    """Return the hash that a harness computes from all results if they equal Python's."""
    bits, kind = 2166136261, "<f4" if precision == "single" else "<f8"
    for each in every:
        for byte in np.ascontiguousarray(each.after, dtype=kind).tobytes():
            bits = (bits ^ byte) * 16777619 & 0xFFFFFFFF
    return f"{bits:08x}"


needs_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")


def bench_of(structure: str) -> bywire.Bench:
    """Return the bench of a structure."""
    experiment, parameters, overrides = STRUCTURES[structure]
    return bywire.Bench(experiment, parameters, overrides=overrides)


@dataclass(frozen=True)
class Built:
    """A compiled harness with the compiler's output."""

    folder: Path
    program: Path
    said: str

    def run(self) -> subprocess.CompletedProcess[str]:
        """Compare the compiled ECU with its vectors."""
        return subprocess.run([self.program], capture_output=True, text=True, check=False)


def build(folder: Path, *flags: str, name: str = "harness") -> Built:
    """Compile all C files of a folder."""
    target = folder / name
    done = subprocess.run(
        ["gcc", *(flags or FLAGS), *sorted(map(str, folder.glob("*.c"))), "-o", str(target), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return Built(folder, target, done.stderr)
