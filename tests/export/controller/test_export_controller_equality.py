"""The compiled ECU equals the Python that it was translated from."""

from __future__ import annotations

from pathlib import Path

import pytest
from exported_ecu import STRUCTURES, bench_of, build, needs_compiler

from bywire.api.export_controller import export_controller
from bywire.export.controller.harness import FLAGS, WARNINGS


@needs_compiler
@pytest.mark.parametrize("structure", STRUCTURES)
def test_double_equals_python_in_every_bit(structure: str, tmp_path: Path) -> None:
    made = export_controller(bench_of(structure), tmp_path, vectors=2000)
    built = build(tmp_path, *FLAGS, *WARNINGS)
    assert built.said == ""
    done = built.run()
    expected = 2000 * len(made.program.steps)
    assert done.returncode == 0
    assert done.stdout.startswith(f"{expected} vectors, 0 values differ, bits ")


@needs_compiler
@pytest.mark.parametrize("structure", STRUCTURES)
def test_single_equals_python_in_single_precision(structure: str, tmp_path: Path) -> None:
    export_controller(bench_of(structure), tmp_path, precision="single", vectors=300)
    built = build(tmp_path, *FLAGS, *WARNINGS)
    assert built.said == ""
    done = built.run()
    assert done.returncode == 0, done.stdout
