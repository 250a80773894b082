"""The compiled ECU equals the Python that it was translated from, in every bit."""

from __future__ import annotations

from pathlib import Path

import pytest
from exported_ecu import STRUCTURES, bench_of, bits_of, build, needs_compiler

from bywire.export.controller.files import files
from bywire.export.controller.harness import FLAGS, WARNINGS
from bywire.export.controller.program import program
from bywire.export.controller.vectors import vectors


@needs_compiler
@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize(("precision", "count"), [("double", 2000), ("single", 300)])
def test_results_are_those_of_python(
    structure: str, precision: str, count: int, tmp_path: Path
) -> None:
    case = bench_of(structure).cases()[0]
    made = program(case.model, case.par, precision)
    assert made.inexact == ()
    every = vectors(made, case.memory, count)
    for name, text in files(made, case.memory, {}, every).items():
        (tmp_path / name).write_text(text)
    built = build(tmp_path, *FLAGS, *WARNINGS)
    assert built.said == ""
    done = built.run()
    bits = bits_of(precision, every)
    expected = f"{count * len(made.steps)} vectors, 0 values differ, bits {bits}\n"
    assert (done.returncode, done.stdout) == (0, expected)
