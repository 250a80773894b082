"""Software in the loop: the compiled ECU drives the plant of a bench."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported_ecu import bench_of, needs_compiler
from numpy.testing import assert_array_equal

from bywire.api.export_controller import export_controller
from bywire.core.typing import Array
from bywire.export.controller.c_text import c_name
from bywire.export.controller.harness import FLAGS
from bywire.export.controller.program import Program
from bywire.simulation.engine import prepare
from bywire.simulation.run import Run, initial_vector, request_for, simulate

NEVER = 2**40
Tick = Callable[[Any, Any, Any], Any]


def in_the_loop(run: Run, ticks: Sequence[Tick]) -> Array:
    """Return the states at every frame where the tasks are ticked from outside.

    The kernel's own ticks never come due: its frames are counted from one on.
    """
    model, engine, request = run.model, prepare(run.model, run.par).engine(), request_for(run)
    schedule, layout = request.schedule, engine.layout
    aside = replace(
        schedule, frames=NEVER, record_frames=NEVER,
        task_frames=tuple(NEVER for _ in schedule.task_frames),
    )  # fmt: skip
    plant = replace(request, schedule=aside)
    vector = initial_vector(layout, run.state, run.memory)
    x = slice(layout.start["x"], layout.start["x"] + layout.length["x"])
    m = slice(layout.start["m"], layout.start["m"] + layout.length["m"])
    states, rows = [], np.empty((1, len(request.selection)))
    for frame in range(schedule.frames):
        states.append(vector[x].copy())
        u = model.Stimulus(*request.stimulus[frame // schedule.stimulus_frames].tolist())
        for every, tick in zip(schedule.task_frames, ticks, strict=True):
            if frame % every == 0:
                state = model.State(*vector[x].tolist())
                vector[m] = tick(state, model.Memory(*vector[m].tolist()), u)
        engine.advance(plant, vector, frame + 1, frame + 2, rows)
    return np.array([*states, vector[x]])


def compiled(program: Program, folder: Path) -> list[Tick]:
    """Return the ticks of the compiled ECU."""
    model, name = program.model, program.name
    sources = [str(f) for f in sorted(folder.glob("*.c")) if not f.name.endswith("_harness.c")]
    library = str(folder / "ecu.so")
    subprocess.run(["gcc", *FLAGS, "-shared", "-fPIC", *sources, "-o", library, "-lm"], check=True)
    loaded = ctypes.CDLL(library)
    real = ctypes.c_float if program.precision.name == "single" else ctypes.c_double
    kinds = {"x": model.State, "u": model.Stimulus, "memory": model.Memory}
    structs = {
        short: type(short, (ctypes.Structure,), {
            "_fields_": [(c_name(each.name), real) for each in program.members(cls)]
        })
        for short, cls in kinds.items()
    }  # fmt: skip
    names = {short: [e.name for e in program.members(cls)] for short, cls in kinds.items()}
    parameters = ctypes.c_char.in_dll(loaded, f"{name}_parameters")

    def tick_of(step: Any) -> Tick:
        function = getattr(loaded, step.name)
        function.restype = None

        def tick(x: Any, m: Any, u: Any) -> Any:
            given = {"x": x, "u": u, "memory": m}
            held = {
                short: structs[short](*(getattr(given[short], n) for n in names[short]))
                for short in kinds
            }
            wanted = [short for _, short in step.arguments]
            function(*(ctypes.byref(parameters if s == "par" else held[s]) for s in wanted))
            after = {n: getattr(held["memory"], c_name(n)) for n in names["memory"]}
            return m._replace(**after)

        return tick

    return [tick_of(step) for step in program.steps]


def in_python(run: Run) -> list[Tick]:
    """Return the ticks as Python computes them."""

    def tick_of(task: Any) -> Tick:
        return lambda x, m, u: task.tick(x, m, u, run.par)

    return [tick_of(task) for task in run.model.tasks(run.par)]


@needs_compiler
@pytest.mark.parametrize("structure", ["pressure, sine dither", "moment and position"])
def test_double_in_the_loop_equals_python_in_every_bit(structure: str, tmp_path: Path) -> None:
    bench = bench_of(structure)
    made = export_controller(bench, tmp_path, vectors=1)
    run = replace(next(iter(bench.runs().values())), duration=0.5)
    looped = in_the_loop(run, compiled(made.program, tmp_path))
    assert_array_equal(looped, in_the_loop(run, in_python(run)))


@needs_compiler
@pytest.mark.parametrize(("precision", "most"), [("double", 1e-4), ("single", 1e3)])
def test_pressure_is_that_of_the_bench(precision: str, most: float, tmp_path: Path) -> None:
    bench = bench_of("pressure, sine dither")
    made = export_controller(bench, tmp_path, precision=precision, vectors=1)
    run = next(iter(bench.runs().values()))
    looped = in_the_loop(run, compiled(made.program, tmp_path))
    pressure = looped[:, run.model.State._fields.index("p_mc")]
    schedule = run.schedule()
    apart = pressure[:: schedule.record_frames] - simulate(run, ("p_mc",))["p_mc"]
    assert np.abs(apart).max() < most
