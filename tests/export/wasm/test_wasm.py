"""WebAssembly modules in Node: bit-identical to the bench's own run."""

from __future__ import annotations

import json
import shutil
import subprocess
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bywire
from bywire.bench.running import run_of
from bywire.core.errors import CompilerError, ParameterError
from bywire.export.wasm import module
from bywire.simulation.run import sampled_stimulus
from bywire.usecases.export import export_wasm

NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(NODE is None, reason="there is no node to run the modules in")
DRIVER = Path(__file__).with_name("drive.mjs")
OPTIONS = {"t_hold": "60 ms", "pulses": 1, "t_low": "20 ms", "t_high": "20 ms", "settle": "20 ms"}
BENCHES = {
    "motorcycle": bywire.Bench(
        "hard-braking", "dardanelli2010", options={"settle": 0.04, "duration": 0.1}, name="stop"
    ),
    "wedge": bywire.Bench("moment-pulses", "roberts2003", options=OPTIONS, name="stop"),
}


@pytest.fixture(scope="module", params=sorted(BENCHES))
def bench(request: pytest.FixtureRequest) -> bywire.Bench:
    return BENCHES[request.param]


@pytest.fixture(scope="module")
def folder(bench: bywire.Bench, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("wasm")
    export_wasm(bench, made)
    return made


def driven(folder: Path, **task: Any) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the driver's output, and the signals by name."""
    path = folder / "task.json"
    path.write_text(json.dumps(task))
    call = [str(NODE), str(DRIVER), str(folder), "stop", str(path)]
    done = subprocess.run(call, capture_output=True, text=True, check=True, timeout=120)
    said = json.loads(done.stdout)
    if "error" in said:
        return said, {}
    table = np.fromfile(f"{path}.bin").reshape(len(said["names"]), said["rows"])
    return said, dict(zip(said["names"], table, strict=True))


def recorded(bench: bywire.Bench) -> tuple[Any, dict[str, list[float]]]:
    """Return the bench's own run, and the rows of its stimulus by name."""
    run = run_of(bench, bench.cases()[0], 0)
    rows = sampled_stimulus(run, run.schedule())
    names = run.model.Stimulus._fields
    return bywire.simulate(run), {name: rows[:, k].tolist() for k, name in enumerate(names)}


def test_every_row_is_the_benchs_own(bench: bywire.Bench, folder: Path) -> None:
    run, stimulus = recorded(bench)
    said, signals = driven(folder, stimulus=stimulus)
    assert said["settled"]
    assert {each["module"] for each in said["imports"]} <= {"math", "env"}
    for name, row in signals.items():
        assert np.array_equal(row, run[name]), name


def test_a_brake_takes_no_more_than_10_kb(folder: Path) -> None:
    assert len(zlib.compress((folder / "stop.wasm").read_bytes(), 9)) < 10_000


def test_changed_parameters_begin_at_rest_and_run_alike(folder: Path) -> None:
    description = json.loads((folder / "stop.json").read_text())
    assert description["beginsAtRest"]
    is_motorcycle = description["model"] == "motorcycle-brake"
    name = "caliper.K_pd" if is_motorcycle else "caliper.clearance"
    changed = BENCHES["motorcycle" if is_motorcycle else "wedge"].with_overrides({name: "-10%"})
    run, stimulus = recorded(changed)
    value = changed.par.value(name)
    _, signals = driven(folder, parameters={name: value}, stimulus=stimulus)
    signal = "p_mc" if is_motorcycle else "F_N"
    size = np.abs(run[signal]).max()
    assert size > 0
    np.testing.assert_allclose(signals[signal], run[signal], rtol=0, atol=1e-7 * size)


@pytest.mark.parametrize(
    ("task", "said"),
    [
        ({"parameters": {"motor.R": 1.0}}, "RangeError: unknown parameter 'motor.R'"),
        ({"parameters": {"caliper.clearance": "x"}}, "is not valid: it must be >= 0 m"),
        ({"parameters": {"caliper.clearance": -1.0}}, "caliper.clearance = -1 m is not valid"),
        ({"stimulus": {"demand": [1.0]}}, "unknown stimulus 'demand'"),
        ({"stimulus": {"M_set": [1.0]}}, "M_set has 1 rows, but the run needs "),
        ({"duration": -1.0}, "duration must be > 0"),
        ({"duration": 1e12}, "duration = 1000000000000 s"),
    ],
)
def test_what_does_not_fit_is_said(tmp_path_factory, task: Any, said: str) -> None:
    folder = tmp_path_factory.getbasetemp() / "wedge"
    if not folder.exists():
        export_wasm(BENCHES["wedge"], folder)
    assert said in driven(folder, **task)[0]["error"]


def test_without_its_compiler_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "bundled_compiler", lambda: None)
    with pytest.raises(CompilerError, match=r"pip install -e '\.\[compiler\]'"):
        export_wasm(BENCHES["motorcycle"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_one_run_is_exported(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="has 9 runs"):
        export_wasm("friction-sweep", tmp_path)
