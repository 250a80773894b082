"""CAN messages of an exported ECU: another DBC reader decodes the values of the memory."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exported_ecu import BRAKES, bench_of, needs_compiler

from bywire.core.signals import signals_of
from bywire.export.controller.files import CYCLE, FIRST, NOT_AVAILABLE, messages
from bywire.export.controller.harness import FLAGS, WARNINGS
from bywire.usecases.export import export_controller

formats = pytest.importorskip("canmatrix.formats", reason="canmatrix is not installed")


@needs_compiler
@pytest.mark.parametrize("precision", ["double", "single"])
def test_another_reader_decodes_what_the_ecu_sends(precision: str, tmp_path: Path) -> None:
    bench = bench_of(BRAKES[1])
    made = export_controller(bench, tmp_path, precision=precision, vectors=1, dbc=True)
    program, name = made.program, made.program.name
    assert f"{name}.dbc" in made.files
    (matrix,) = formats.loadp(str(tmp_path / f"{name}.dbc")).values()
    fields = [each.name for each in program.members(program.model.Memory)]
    signals = signals_of(program.model.Memory)
    library = str(tmp_path / "can.so")
    said = subprocess.run(
        [
            "gcc",
            *FLAGS,
            *WARNINGS,
            "-shared",
            "-fPIC",
            str(tmp_path / f"{name}_can.c"),
            "-o",
            library,
        ],
        capture_output=True,
        text=True,
        check=True,
    ).stderr
    assert said == ""
    fill = getattr(ctypes.CDLL(library), f"{name}_can_fill")
    real = ctypes.c_float if precision == "single" else ctypes.c_double
    rng = np.random.default_rng(3)
    nominal = np.array([signals[field].nominal for field in fields])
    values = nominal * rng.uniform(-3.0, 3.0, len(fields))
    values[0] = 1e9 * nominal[0]  # stays at full scale
    missing = dict(zip(fields[1:4], (np.nan, np.inf, -np.inf), strict=True))
    values[1:4] = list(missing.values())

    class Memory(ctypes.Structure):
        _fields_ = [
            ("numbers", real * len(fields)),
            ("statuses", ctypes.c_uint32 * len(program.steps)),
        ]

    memory = Memory((real * len(fields))(*values), (1, 2))
    data = (ctypes.c_uint8 * 8)()
    seen = {}
    for number, sent in enumerate(messages(program)):
        frame = matrix.frame_by_id(formats.canmatrix.ArbitrationId(FIRST + number))
        assert (frame.size, frame.cycle_time) == (8, CYCLE)
        fill(ctypes.c_uint32(number), ctypes.byref(memory), data)
        decoded = frame.decode(bytes(data))
        for each in sent:
            signal = frame.signal_by_name(each.name)
            assert (signal.unit, signal.comment) == (each.unit, each.label)
            if each.field in missing:
                assert decoded[each.name].raw_value == NOT_AVAILABLE
                assert decoded[each.name].named_value == "not available"
                assert NOT_AVAILABLE * each.factor < float(signal.min)  # outside its range
                seen[each.field] = np.nan
                continue
            seen[each.field] = float(decoded[each.name].phys_value)
            if each.field not in fields:
                continue
            expected = min(values[fields.index(each.field)], float(signal.max))
            assert abs(seen[each.field] - expected) <= 0.5001 * each.factor
            assert float(signal.max) >= 10.0 * signals[each.field].nominal
    assert list(seen) == [*fields, "status_moment", "status_position"]
    assert (seen["status_moment"], seen["status_position"]) == (1.0, 2.0)
