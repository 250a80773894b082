"""Errors of exports, and the export of a user's brake."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from exported_ecu import bench_of, build, needs_compiler

import bywire
from bywire.core.errors import FileError, ModelError, ParameterError, UnknownNameError
from bywire.core.model import Task
from bywire.core.parameters import leaf_fields
from bywire.core.signals import signals_of
from bywire.export.controller.program import program
from raising import raises

EXAMPLE = Path(__file__).parents[3] / "examples" / "emb_caliper"


def branching(x: Any, m: Any, u: Any, par: Any) -> Any:
    """Branch on a value, which a symbol cannot do."""
    if m.p_meas > 0.0:
        return m
    return m._replace(duty=0.0)


def endless(x: Any, m: Any, u: Any, par: Any) -> Any:
    """Call itself."""
    return endless(x, m, u, par)


def unknown(x: Any, m: Any, u: Any, par: Any) -> Any:
    """Call a function that is not a law."""
    return m._replace(duty=divmod(m.duty, 2.0)[0])


def crossed(x: Any, m: Any, u: Any, par: Any) -> Any:
    """Use an operator that numbers do not have."""
    return m._replace(duty=m.duty @ 2.0)


def beyond(x: Any, m: Any, u: Any, par: Any) -> Any:
    """Read beyond the end of a tuple."""
    return m._replace(duty=m.duty * (1.0, 2.0)[2])


@pytest.mark.parametrize(
    ("tick", "value", "reason"),
    [
        (crossed, "m.duty @ 2.0", "operator"),
        (beyond, "(1.0, 2.0)[2]", "tuple index out of range"),
        (branching, "m.p_meas > 0.0", "ops.where"),
        (endless, "", "endless"),
        (unknown, "divmod(m.duty, 2.0)", "divmod"),
    ],
)
def test_operation_and_line_are_named(tick: Any, value: str, reason: str) -> None:
    case = bench_of("pressure, sine dither").cases()[0]

    class Changed(type(case.model)):  # type: ignore[misc]
        def tasks(self, par: Any) -> tuple[Task, ...]:
            return (Task("ecu", 1e-3, tick),)

    with raises(ModelError, value=value) as error:
        program(Changed(), case.par)
    assert f"{Path(__file__).name}, line " in str(error.value)
    assert reason in str(error.value)


def test_bad_requests_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'single'"):
        bywire.export_controller("hard-braking", tmp_path, precision="singel")
    with pytest.raises(ParameterError, match="vectors = 0 must be a whole number"):
        bywire.export_controller("hard-braking", tmp_path, vectors=0)
    (tmp_path / "file").write_text("")
    with raises(FileError, name=str(tmp_path / "file")):
        bywire.export_controller("hard-braking", tmp_path / "file", vectors=1)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@needs_compiler
def test_an_experiment_without_runs_has_no_controller(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="without any run"):
        bywire.export_controller("seal-stribeck", out=tmp_path / "ecu")


def test_a_brake_of_ones_own(tmp_path: Path) -> None:
    bench = EXAMPLE / "benches" / "step_from_5kN.toml"
    words = ["--system", EXAMPLE, "export", "controller", bench, "--out", tmp_path]
    subprocess.run([sys.executable, "-m", "bywire", *map(str, words)], check=True)
    done = build(tmp_path).run()
    header = next(tmp_path.glob("*_ecu.h")).read_text()
    assert re.findall(r"_ecu_step_(\w+)\(", header) == ["force", "speed", "current"]
    assert done.returncode == 0
    assert done.stdout.startswith("600 vectors, 0 values differ, bits ")


def test_description_names_what_is_read(tmp_path: Path) -> None:
    made = bywire.export_controller("moment-pulses", tmp_path, vectors=1)
    text = (tmp_path / "wedge_brake.a2l").read_text()
    assert text.count("/begin CHARACTERISTIC") == len(made.program.parameters())
    assert text.count("/begin") == text.count("/end")
    assert 'SYMBOL_LINK "wedge_brake_calibration.control.moment.f_c" 0' in text
    assert 'SYMBOL_LINK "wedge_brake_memory.i_1_ref" 0' in text


NO_READER = (
    "pya2l is not installed: its wheel of 89 MB, 254 MB unpacked, carries libraries for nine "
    "platforms, too much to ask of every environment; pip install pya2l"
)


@pytest.mark.parametrize("experiment", ["straight-stop", "hard-braking", "moment-pulses"])
def test_a_reader_finds_what_is_declared(tmp_path: Path, experiment: str) -> None:
    parser = pytest.importorskip("pya2l.parser", reason=NO_READER)
    made = bywire.export_controller(experiment, tmp_path, vectors=1).program
    with parser.A2lParser() as reader:
        tree = reader.tree_from_a2l((tmp_path / f"{made.name}.a2l").read_bytes())
    (module,) = tree.PROJECT.MODULE
    units = {each.Name.Value: each.Unit.Value for each in module.COMPU_METHOD}

    leaves = leaf_fields(type(made.par))
    read = {each.Name.Value: each for each in module.CHARACTERISTIC}
    assert list(read) == [name for name, _ in made.parameters()]
    for name, member in made.parameters():
        each, leaf = read[name], leaves[name]
        limits = (each.LowerLimit.Value, each.UpperLimit.Value)
        assert limits == (max(leaf.low, -1e32), min(leaf.high, 1e32)), name
        assert units[each.Conversion.Value] == leaf.unit.symbol
        assert each.Type == ("VAL_BLK" if member.length else "VALUE")
        assert each.NUMBER.Number.Value == (member.length or 0)
        assert each.SYMBOL_LINK.SymbolName.Value == f"{made.name}_parameters.{name}"

    signals = signals_of(made.model.Memory)
    measured = {each.Name.Value: each for each in module.MEASUREMENT}
    assert list(measured) == [f"memory.{m.name}" for m in made.members(made.model.Memory)]
    for name, each in measured.items():
        signal = signals[name.removeprefix("memory.")]
        assert units[each.Conversion.Value] == signal.unit
        assert each.LongIdentifier.Value == signal.label
        assert each.SYMBOL_LINK.SymbolName.Value == f"{made.name}_{name}"
