"""Clients other than FMPy, where they are installed: fmusim (Reference FMUs), libcosim."""

from __future__ import annotations

import csv
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract, read_model_description

import bywire
from bywire.usecases.export import export_fmu
from export.fmu.test_fmu_exchange import SHORT_STOP, TICK, solved
from systems.loading import loaded

CALIPER = Path(__file__).parents[3] / "examples" / "emb_caliper"
BENCHES = {
    "motorcycle": SHORT_STOP,
    "wedge": bywire.Bench(
        "moment-pulses",
        "roberts2003",
        options={
            "t_hold": "60 ms",
            "pulses": 1,
            "t_low": "20 ms",
            "t_high": "20 ms",
            "settle": "20 ms",
        },
    ),
    "caliper": None,  # loaded when it is its turn
}


def _has_fmusim() -> bool:
    tool = shutil.which("fmusim")
    if tool is None:
        return False
    done = subprocess.run([tool, "--help"], capture_output=True, text=True, check=False)
    return "--interface-type" in done.stdout


needs_fmusim = pytest.mark.skipif(
    not _has_fmusim(), reason="fmusim of the Reference FMUs, up to 0.0.39, is not installed"
)


@pytest.fixture(scope="module", params=BENCHES)
def bench(request: pytest.FixtureRequest) -> bywire.Bench:
    if request.param != "caliper":
        yield BENCHES[request.param]
        return
    with loaded(CALIPER):
        yield bywire.Bench("clamp-step", "emb42v")


class Unit:
    """An FMU with its inputs and the bench's recording."""

    def __init__(self, path: Path) -> None:
        folder = Path(extract(str(path), unzipdir=str(path.with_suffix(""))))
        self.path, self.folder = path, folder
        self.reference = np.genfromtxt(
            folder / "documentation" / "reference.csv", delimiter=",", names=True
        )
        described = read_model_description(str(path)).modelVariables
        names = self.reference.dtype.names
        self.inputs = [v.name for v in described if v.causality == "input" and v.name in names]
        self.sampled = [v.name for v in described if v.name.startswith("sampled.")]
        self.numbers = {v.name: v.valueReference for v in described}

    def by_fmusim(self, *options: str, of: list[str]) -> np.ndarray:
        with (self.folder / "in.csv").open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["time", *self.inputs])
            rows.writerows([row["time"], *(row[n] for n in self.inputs)] for row in self.reference)
        asked = [each for name in of for each in ("--output-variable", name)]
        subprocess.run(
            [
                "fmusim",
                *options,
                "--stop-time",
                repr(float(self.reference["time"][-1])),
                "--output-interval",
                repr(TICK),
                "--input-file",
                "in.csv",
                "--output-file",
                "out.csv",
                *asked,
                str(self.path),
            ],
            cwd=self.folder,
            check=True,
            capture_output=True,
            timeout=120,
        )
        return np.genfromtxt(
            self.folder / "out.csv", delimiter=",", names=True, deletechars="", replace_space=" "
        )


@needs_fmusim
@pytest.mark.parametrize("version", [2, 3])
def test_fmusim_steps_it_as_the_bench_does(
    bench: bywire.Bench, version: int, tmp_path: Path
) -> None:
    unit = Unit(export_fmu(bench, tmp_path, fmi=version).path)
    got = unit.by_fmusim("--interface-type", "cs", of=unit.sampled)
    assert len(got) == len(unit.reference) > 100
    for name in unit.sampled:  # fmusim writes 16 digits
        expected = unit.reference[name.removeprefix("sampled.")][:-1]
        np.testing.assert_allclose(got[name][1:], expected, rtol=1e-15, err_msg=name)


@needs_fmusim
@pytest.mark.parametrize("version", [2, 3])
def test_fmusim_integrates_the_plant_as_fmpy_does(
    bench: bywire.Bench, version: int, tmp_path: Path
) -> None:
    """After jumps of inputs, the solver restarts only if the FMU reports changed states."""
    unit = Unit(export_fmu(bench, tmp_path, kind="model-exchange", fmi=version).path)
    signal = next(n for n in ("p_mc", "M_B", "F_cl") if n in unit.numbers)
    solver = ("--interface-type", "me", "--solver", "cvode", "--tolerance", "1e-10")
    rows = unit.by_fmusim(*solver, of=[signal])
    ends = unit.reference["time"]  # between which there are rows of events
    got = rows[signal][[np.flatnonzero(abs(rows["time"] - t) < 1e-9)[0] for t in ends]]
    inputs = {name: unit.reference[name] for name in unit.inputs}
    expected = solved(unit.path, inputs, [signal], 1e-10)[:, 0]
    assert np.abs(got - expected).max() < 3e-8 * np.abs(expected).max() > 0.0


def test_libcosim_steps_it_as_the_bench_does(bench: bywire.Bench, tmp_path: Path) -> None:
    execution = pytest.importorskip("libcosimpy.CosimExecution", reason="it is not installed")
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    unit = Unit(export_fmu(bench, tmp_path).path)
    run = execution.CosimExecution.from_step_size(step_size=round(TICK * 1e9))
    slave = CosimLocalSlave(fmu_path=str(unit.path), instance_name="brake")
    index = run.add_local_slave(slave)
    given, seen = CosimManipulator.create_override(), CosimObserver.create_last_value()
    run.add_manipulator(given)
    run.add_observer(seen)
    inputs, sampled = ([unit.numbers[n] for n in names] for names in (unit.inputs, unit.sampled))
    for row in unit.reference[:-1]:
        assert given.slave_real_values(index, inputs, [float(row[n]) for n in unit.inputs])
        assert run.step()
        got = seen.last_real_values(index, sampled)
        assert got == [row[name.removeprefix("sampled.")] for name in unit.sampled]
