"""Exports of a brake with stop operators: the digits of the bench, or what a solver finds."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.validation import validate_fmu

import bywire
from bywire.bench.running import run_of
from bywire.core.model import Task
from bywire.export.loop_source import loop_source
from bywire.simulation.run import sampled_stimulus
from bywire.usecases.export import export_fmu, export_wasm
from export.fmu.clients import Client
from export.fmu.test_fmu_exchange import reference, solved
from systems import pad_press

DRIVER = Path(__file__).with_name("wasm") / "drive.mjs"
NODE = shutil.which("node")


@pytest.fixture(scope="module")
def bench() -> bywire.Bench:
    bywire.load_system(str(pad_press.__file__))
    return bywire.Bench("press-and-release", "press-one", name="stop")


def test_an_fmu_has_the_rows_of_the_bench(bench: bywire.Bench, tmp_path: Path) -> None:
    made = export_fmu(bench, tmp_path)
    each = Client(made.path, made.path.with_suffix("")).begin()
    got = np.array(each.follow(1e-3))
    reference = each.reference()
    names = each.of("local")
    assert {"sampled.z_1", "sampled.E_pads"} <= set(names)
    for k, signal in enumerate(names):
        expected = reference[signal.removeprefix("sampled.")][:-1]
        assert np.array_equal(got[:, k], expected), signal
    assert reference["E_pads"][-1] > 0.01


@pytest.mark.parametrize("parameters", ["press-one", "press-by-load"])
def test_kernels_converge_to_what_another_solver_finds(
    parameters: str, bench: bywire.Bench, tmp_path: Path
) -> None:
    """Model exchange with CVODE, which locates every beginning of slip; also with changing widths.

    The torque of the controller is held from tick to tick, as in the bench.
    """
    pressed = bywire.Bench("press-and-release", parameters, name="stop")
    made = export_fmu(pressed, tmp_path, kind="model-exchange")
    assert validate_fmu(str(made.path)) == []
    torque = reference(made)["T"]
    names = ["theta", "z_1", "z_4", "F"]
    modes = ["mode.z_1", "mode.omega"]
    exact = solved(made.path, {"T": torque}, [*names, *modes, "mode.changes"], 1e-10)
    for k in (4, 5):
        assert set(exact[:, k]) == {-1.0, 0.0, 1.0}
    assert exact[-1, 6] > 15.0  # changes of modes
    run = _by_torque(run_of(pressed, pressed.cases()[0], 0), torque)
    errors = []
    for step in (4e-5, 2e-5, 1e-5):
        found = bywire.simulate(replace(run, step=step))
        errors.append([np.abs(found[n] - exact[:, k]).max() for k, n in enumerate(names)])
    for k, name in enumerate(names):
        assert errors[1][k] < 1e-5 * np.abs(exact[:, k]).max(), name
        assert errors[2][k] < errors[0][k] / 11.0, name


def _by_torque(run: Any, torque: np.ndarray) -> Any:
    """Return a run with a prescribed torque in place of the controller."""

    class Prescribed(pad_press.PadPress):
        def tasks(self, par: Any) -> Any:
            return (Task("prescribed", par.T_s, lambda x, m, u, p: pad_press.Memory(u.angle_set)),)

    def stimulus(t: np.ndarray) -> np.ndarray:
        return torque[np.minimum(np.rint(t / run.par.T_s).astype(int), len(torque) - 1)][:, None]

    return replace(run, model=Prescribed(), stimulus=stimulus)


@pytest.mark.skipif(NODE is None, reason="there is no node to run the modules in")
def test_a_module_has_the_rows_of_the_bench(bench: bywire.Bench, tmp_path: Path) -> None:
    export_wasm(bench, tmp_path)
    run: Any = run_of(bench, bench.cases()[0], 0)
    rows = sampled_stimulus(run, run.schedule())
    stimulus = {name: rows[:, k].tolist() for k, name in enumerate(run.model.Stimulus._fields)}
    path = tmp_path / "task.json"
    path.write_text(json.dumps({"stimulus": stimulus}))
    call = [str(NODE), str(DRIVER), str(tmp_path), "stop", str(path)]
    done = subprocess.run(call, capture_output=True, text=True, check=True, timeout=120)
    said = json.loads(done.stdout)
    assert said["settled"]
    table = np.fromfile(f"{path}.bin").reshape(len(said["names"]), said["rows"])
    expected = bywire.simulate(run)
    for name, row in zip(said["names"], table, strict=True):
        assert np.array_equal(row, expected[name]), name


def test_a_page_s_loop_knows_how_far_it_is_from_slip() -> None:
    source = loop_source(pad_press.LOOP, pad_press.PAR)
    assert source is not None
    assert source.contacts == 4
    unused = loop_source(pad_press.LOOP, pad_press.PAR.replace({"pads.W_4": 0.0}))
    assert unused is not None
    assert unused.contacts == 3
