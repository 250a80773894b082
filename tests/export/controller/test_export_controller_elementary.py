"""Elementary functions in exported C are bit-identical to Python's, without the C library."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple

import pytest
from exported_ecu import build, needs_compiler

from bywire.core import ops
from bywire.core.model import Task
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Signal
from bywire.export.controller.files import files
from bywire.export.controller.harness import FLAGS, WARNINGS
from bywire.export.controller.program import program
from bywire.export.controller.vectors import vectors

Number = Annotated[float, Signal("1", "a number", 1.0)]


class Memory(NamedTuple):
    """Results of functions."""

    a: Number
    exp: Number
    log: Number
    power: Number
    sine: Number
    cosine: Number
    floor: Number


class Nothing(NamedTuple):
    """No signals."""


class Parameters(ParameterSet):
    """No parameters."""


def bounded(m: Memory) -> Memory:
    """Return the memory after calls of the functions that exist in both precisions."""
    return m._replace(
        exp=ops.exp(20.0 * m.a),
        sine=ops.sin(3.0 * m.a),
        cosine=ops.cos(4000.0 * m.a),
        floor=ops.floor(7.0 * m.a),
    )


def tick(x: Nothing, m: Memory, u: Nothing, par: Parameters) -> Memory:
    """Call all functions."""
    size = ops.fabs(m.a) + 0.01
    return bounded(m)._replace(log=ops.log(size), power=ops.power(size, 0.3 * m.a))


@needs_compiler
@pytest.mark.parametrize("precision", ["double", "single"])
def test_all_functions_equal_python(precision: str, tmp_path: Path) -> None:
    law = tick if precision == "double" else (lambda x, m, u, par: bounded(m))
    model: Any = SimpleNamespace(
        name="functions",
        State=Nothing,
        Stimulus=Nothing,
        Memory=Memory,
        tasks=lambda par: [Task("only", 0.001, law)],
    )
    made, start = program(model, Parameters(), precision), Memory(*[0.5] * 7)
    assert {each.rstrip("f") for each in made.libraries} == {"fabs"}
    for name, text in files(made, start, {}, vectors(made, start, 1000)).items():
        (tmp_path / name).write_text(text)
    built = build(tmp_path, *FLAGS, *WARNINGS)
    assert built.said == ""
    assert built.run().stdout.startswith("1000 vectors, 0 values differ, bits ")
