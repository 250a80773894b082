"""Software in the loop: the compiled ECU drives the plant of a bench."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported_ecu import bench_of, needs_compiler
from numpy.testing import assert_array_equal
from typer.testing import CliRunner

import bywire
from bywire.bench.bench_file import load
from bywire.cli.app import app
from bywire.core.errors import UnknownNameError
from bywire.core.typing import Array
from bywire.simulation.engine import prepare
from bywire.simulation.run import Run, initial_vector, request_for, simulate
from run_once import run_once

NEVER = 2**40
Tick = Callable[[Any, Any, Any], Any]


def in_python(run: Run) -> Array:
    """Return the state vector at the end of a run in which Python computes the ticks.

    The kernel's own ticks never come due: its frames are counted from one on.
    """
    model, engine, request = run.model, prepare(run.model, run.par).engine(), request_for(run)
    schedule, layout = request.schedule, engine.layout
    aside = replace(
        schedule,
        frames=NEVER,
        record_frames=NEVER,
        task_frames=tuple(NEVER for _ in schedule.task_frames),
    )
    plant = replace(request, schedule=aside)
    vector = initial_vector(layout, run.state, run.memory)
    x = slice(layout.start["x"], layout.start["x"] + layout.length["x"])
    m = slice(layout.start["m"], layout.start["m"] + layout.length["m"])
    rows = np.empty((1, len(request.selection)))
    tasks: Sequence[Any] = model.tasks(run.par)
    for frame in range(schedule.frames + 1):
        u = model.Stimulus(*request.stimulus[frame // schedule.stimulus_frames].tolist())
        for every, task in zip(schedule.task_frames, tasks, strict=True):
            if frame % every == 0:
                state = model.State(*vector[x].tolist())
                vector[m] = task.tick(state, model.Memory(*vector[m].tolist()), u, run.par)
        if frame < schedule.frames:
            engine.advance(plant, vector, frame + 1, frame + 2, rows)
    return vector


@needs_compiler
@pytest.mark.parametrize("structure", ["pressure, sine dither", "moment and position"])
def test_double_in_the_loop_equals_python_in_every_bit(structure: str) -> None:
    run = replace(next(iter(bench_of(structure).runs().values())), duration=0.2)
    assert_array_equal(simulate(run, engine="sil").vector, in_python(run))


@needs_compiler
@pytest.mark.parametrize(("engine", "most"), [("sil", 1e-4), ("sil-single", 1e3)])
def test_pressure_is_that_of_the_bench(engine: str, most: float) -> None:
    run = next(iter(bench_of("pressure, sine dither").runs().values()))
    looped, expected = simulate(run, engine=engine), simulate(run)
    assert np.abs(looped["p_mc"] - expected["p_mc"]).max() < most
    if engine == "sil":  # no code of a converter is another
        assert_array_equal(looped["p_meas"], expected["p_meas"])
        assert_array_equal(looped["i_meas"], expected["i_meas"])
    else:
        assert (looped["duty"].astype(np.float32) == looped["duty"]).all()


@needs_compiler
def test_bench_file_asks_for_it(tmp_path: Path) -> None:
    file = tmp_path / "looped.toml"
    file.write_text(
        'experiment = "hard-braking"\nparameters = "dardanelli2010"\n'
        '[options]\nduration = "0.3 s"\n[simulation]\nengine = "sil-single"\n'
    )
    assert load(file).engine == "sil-single"
    result = bywire.run(file, estimate_error=False)
    assert result.recording.attrs["engine"].endswith("ECU as C in single precision")
    done = CliRunner().invoke(app(), ["run", str(file), "--engine", "sill", "--no-error-estimate"])
    assert isinstance(done.exception, UnknownNameError)
    assert "did you mean 'sil', 'sil-single'?" in str(done.exception)


@needs_compiler
def test_values_of_a_range_are_looped_each() -> None:
    changes = {"simulation.engine": "sil", "options.duration": "0.05 s"}
    over = bywire.run(
        "hard-braking", changes, over="motor.R_m=0.3 ohm, 0.4 ohm", estimate_error=False
    )
    for result in over.results:
        (recording,) = result.recordings.values()
        assert recording.attrs["engine"].endswith("ECU as C in double precision")


@needs_compiler
def test_faults_pass_through_the_ecu() -> None:
    changes = {"options.duration": "0.4 s"}
    looped, plain = (
        bywire.run(
            "hard-braking",
            changes,
            faults=["pressure.stuck=20 bar@0.2 s"],
            engine=engine,
            estimate_error=False,
        ).recording
        for engine in ("sil", "auto")
    )
    assert float(plain["p_meas"][-1]) == pytest.approx(20e5, rel=1e-3)
    assert_array_equal(looped["p_meas"], plain["p_meas"])


def test_another_engine_is_refused() -> None:
    with pytest.raises(UnknownNameError, match=r"unknown engine 'sill': did you mean 'sil'"):
        run_once("hard-braking", {"simulation.engine": "sill"})
