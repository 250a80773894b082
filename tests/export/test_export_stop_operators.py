"""Exports of a brake with stop operators: digit by digit the bench's own run, or a refusal."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bywire
from bywire.bench.running import run_of
from bywire.core.errors import ModelError
from bywire.export.loop_source import loop_source
from bywire.simulation.run import sampled_stimulus
from bywire.usecases.export import export_fmu, export_wasm
from export.fmu.clients import Client
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


def test_model_exchange_refuses_stop_operators(bench: bywire.Bench, tmp_path: Path) -> None:
    message = r"pad-press has stop operators \(z_1, z_2, z_3, z_4\).*Use co-simulation"
    with pytest.raises(ModelError, match=message):
        export_fmu(bench, tmp_path, kind="model-exchange")
    assert not list(tmp_path.iterdir())


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
