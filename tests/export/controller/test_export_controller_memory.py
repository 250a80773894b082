"""C code changes memory in place, but gives the same values as Python."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple

import pytest
from exported_ecu import BRAKES, bench_of, build, needs_compiler

from bywire.core.model import Task
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Signal
from bywire.export.controller.files import files
from bywire.export.controller.program import program
from bywire.export.controller.vectors import vectors
from bywire.usecases.export import export_controller

Number = Annotated[float, Signal("1", "a number", 1.0)]


class Memory(NamedTuple):
    """Two numbers."""

    a: Number
    b: Number


class Nothing(NamedTuple):
    """No signals."""


class Parameters(ParameterSet):
    """No parameters."""


def swapped(m: Memory) -> Memory:
    """Return the memory with its two numbers swapped."""
    return m._replace(a=m.b, b=m.a)


def summed(m: Memory) -> float:
    """Return a number of a temporary memory."""
    changed = m._replace(a=3.0 * m.a)
    return changed.a + m.a


def counted(m: Memory) -> tuple[Memory, float]:
    """Return the memory, and its previous content."""
    return m._replace(a=m.a + 1.0), m.a


def tick(x: Nothing, m: Memory, u: Nothing, par: Parameters) -> Memory:
    """Read old memory after it has changed."""
    before, m = m, swapped(m)
    total = summed(m)
    m = m._replace(a=m.a + 10.0 * before.a + 100.0 * total)
    kept = m
    m, held = counted(m)
    m = swapped(m._replace(b=held - kept.b))
    return m._replace(b=m.b + kept.a)


@needs_compiler
def test_old_memory_is_read_behind_changes(tmp_path: Path) -> None:
    task = Task("only", 0.001, tick)
    model: Any = SimpleNamespace(
        name="swaps", State=Nothing, Stimulus=Nothing, Memory=Memory, tasks=lambda par: [task]
    )
    made, start = program(model, Parameters()), Memory(1.0, 2.0)
    for name, text in files(made, start, {}, vectors(made, start, 50)).items():
        (tmp_path / name).write_text(text)
    done = build(tmp_path).run()
    assert done.returncode == 0
    assert done.stdout.startswith("50 vectors, 0 values differ, bits ")


@pytest.mark.parametrize("structure", BRAKES[:2])
def test_memory_is_never_handed_on_by_value(structure: str, tmp_path: Path) -> None:
    name = export_controller(bench_of(structure), tmp_path, vectors=1).program.name
    text = (tmp_path / f"{name}_ecu.c").read_text()
    assert f"{name}_Memory *m" in text
    assert text.count(f"{name}_Memory") == text.count(f"{name}_Memory *")
