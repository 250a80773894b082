"""The compiled ECU is bit-identical to the Python code from which it was translated."""

from __future__ import annotations

from pathlib import Path

import pytest
from exported_ecu import BRAKES, STRUCTURES, bench_of, bits_of, build, needs_compiler

from bywire.export.controller.files import files
from bywire.export.controller.harness import FLAGS, WARNINGS
from bywire.export.controller.program import program
from bywire.export.controller.vectors import vectors

MANY, MORE, FEW, DAILY, SINGLE = 2000, 300, 300, 150, 80
LARGE = (*BRAKES, "gains that differ by region")
CASES = [
    *((structure, "double", MORE if structure in LARGE else DAILY) for structure in STRUCTURES),
    *((structure, "single", SINGLE) for structure in LARGE),
    *(pytest.param(structure, "double", MANY, marks=pytest.mark.trust) for structure in STRUCTURES),
    *(pytest.param(structure, "single", FEW, marks=pytest.mark.trust) for structure in STRUCTURES),
]
"""structures whose laws have most branches by many vectors; all of them by many take a minute"""


@needs_compiler
@pytest.mark.parametrize(("structure", "precision", "count"), CASES)
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
    expected = (
        f"{count * len(made.steps)} vectors, 0 values differ, bits {bits}\n"
        "0 breaches of the contract in README.txt\n"
    )
    assert (done.returncode, done.stdout) == (0, expected)
