"""Ensembles: many cases of one model, in lanes and on all cores."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.simulation.compiler import VECTOR, Compiler, compile_library, find_compiler
from bywire.simulation.emission import Layout, layout_of
from bywire.simulation.emit_lanes import emit_lanes
from bywire.simulation.engine import prepare
from bywire.simulation.native import plan_array, pointer
from bywire.simulation.program import Program
from bywire.simulation.run import Run, Trajectory, initial_vector, simulate
from bywire.simulation.schedule import Schedule
from bywire.simulation.stages import build_stages

Array = NDArray[np.float64]
LANES = 16


@dataclass(frozen=True)
class Ensemble:
    """What an ensemble gave.

    Parameters
    ----------
    time, values
        Shapes (rows,) and (cases, rows, signals).
    names
        Signals, in the order of the last axis.
    unsettled, repeated
        Per case, substeps that hit the cap and that took more than one pass; shape (cases,).
    """

    time: Array
    values: Array
    names: tuple[str, ...]
    unsettled: NDArray[np.int64]
    repeated: NDArray[np.int64]
    engine: str

    def __getitem__(self, name: str) -> Array:
        """Return one signal, shape (cases, rows)."""
        return np.asarray(self.values[:, :, self.names.index(name)])


class LaneKernel:
    """Compiled kernel for a group of cases."""

    def __init__(self, program: Program, compiler: Compiler, lanes: int) -> None:
        stages = build_stages(program)
        self.layout: Layout = layout_of(stages)
        self.lanes = lanes
        self.label = f"compiled C in {lanes} lanes, {compiler.label}"
        library = compile_library(emit_lanes(stages, lanes), VECTOR, compiler)
        self._run = ctypes.CDLL(str(library)).bw_run_lanes
        self._run.restype = None

    def run(
        self,
        schedule: Schedule,
        parameters: Array,
        stimulus: Array,
        vector: Array,
        selection: NDArray[np.int32],
        rows: Array,
    ) -> None:
        """Run one group to its end; renews ``vector`` and fills ``rows``.

        Parameters
        ----------
        parameters
            Shape (np, lanes).
        stimulus
            Shape (rows, nu) shared by all lanes, or (rows, nu, lanes).
        vector
            State vectors, shape (entries, lanes).
        rows
            Shape (lanes, recorded rows, signals).
        """
        own = stimulus.ndim == 3
        plan = np.concatenate(
            (
                plan_array(schedule, 0, schedule.frames, selection.size),
                [self.lanes if own else 1, int(own), rows.strides[0] // rows.itemsize],
            )
        ).astype(np.int64)
        self._run(
            pointer(parameters),
            ctypes.c_double(schedule.step),
            pointer(stimulus),
            pointer(vector),
            pointer(plan),
            pointer(selection),
            pointer(rows),
        )


def simulate_ensemble(
    run: Run,
    parameters: Sequence[ParameterSet],
    signals: Sequence[str],
    threads: int | None = None,
) -> Ensemble:
    """Compute one run for many parameter sets of the same structure.

    Parameters
    ----------
    run
        Model, initial values, stimulus, steps; its own parameters give the structure.
    parameters
        One parameter set per case; sample times must be those of ``run``.
    signals
        Outputs to record.
    threads
        Threads to use; all cores by default.

    Raises
    ------
    ParameterError
        When a case has another structure or other sample times.
    """
    _require_alike(run, parameters)
    prepared = prepare(run.model, run.par)
    compiler = find_compiler()
    names = tuple(prepared.program.outputs)
    if compiler is None:
        return _one_by_one(run, parameters, tuple(signals))
    kernel = _lane_kernel(prepared.program, compiler, LANES)
    schedule = run.schedule()
    stimulus = np.ascontiguousarray(run.stimulus(schedule.stimulus_times), dtype=np.float64)
    selection = np.array([names.index(s) for s in signals], dtype=np.int32)
    count = len(parameters)
    matrix = np.array([list(par.leaves().values()) for par in parameters])
    values = np.empty((count, schedule.rows, len(signals)))
    counters = np.zeros((count, 2), dtype=np.int64)
    start = initial_vector(kernel.layout, run.state, run.memory)

    def group(first: int) -> None:
        cases = np.minimum(np.arange(first, first + kernel.lanes), count - 1)
        vector = np.ascontiguousarray(np.repeat(start[:, None], kernel.lanes, axis=1))
        full = first + kernel.lanes <= count
        rows = (
            values[first : first + kernel.lanes]
            if full
            else np.empty((kernel.lanes, *values.shape[1:]))
        )
        kernel.run(
            schedule, np.ascontiguousarray(matrix[cases].T), stimulus, vector, selection, rows
        )
        here = min(kernel.lanes, count - first)
        if not full:
            values[first:] = rows[:here]
        counters[first : first + here] = vector[kernel.layout.start["counters"] :, :here].T

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        list(pool.map(group, range(0, count, kernel.lanes)))
    return Ensemble(
        schedule.record_times, values, tuple(signals), counters[:, 0], counters[:, 1], kernel.label
    )


@cache
def _lane_kernel(program: Program, compiler: Compiler, lanes: int) -> LaneKernel:
    return LaneKernel(program, compiler, lanes)


def _require_alike(run: Run, parameters: Sequence[ParameterSet]) -> None:
    structure, schedule = run.par.choices(), run.schedule()
    for number, par in enumerate(parameters):
        if par.choices() != structure:
            raise ParameterError(
                f"case {number} differs from the ensemble in its structural choices: "
                "cases may differ in numbers only"
            )
        periods = [task.period(par) for task in run.model.tasks(par)]
        if periods != [task.period(run.par) for task in run.model.tasks(run.par)]:
            raise ParameterError(
                f"case {number} has other sample times than the ensemble ({schedule.step:g} s "
                "steps): run it apart"
            )


def _one_by_one(run: Run, parameters: Sequence[ParameterSet], signals: tuple[str, ...]) -> Ensemble:
    """Serve without a compiler: the cases one after the other."""
    runs: list[Trajectory] = []
    for par in parameters:
        single = Run(
            run.model, par, run.state, run.memory, run.stimulus, run.duration, run.step, run.record
        )
        runs.append(simulate(single, signals))
    return Ensemble(
        runs[0].time,
        np.array([r.values for r in runs]),
        signals,
        np.array([r.unsettled for r in runs]),
        np.array([r.repeated for r in runs]),
        runs[0].engine,
    )
