"""Ensembles: many cases of one model, in lanes and on all cores."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.simulation.advance import require_finite
from bywire.simulation.compiler import IN_TURN, VECTOR, Compiler, find_compiler, load_library
from bywire.simulation.engine import Prepared, built_once, prepare
from bywire.simulation.kernel_cache import load
from bywire.simulation.layout import Layout
from bywire.simulation.native import plan_array, pointer
from bywire.simulation.run import (
    Run,
    initial_vector,
    sampled_stimulus,
    selected,
    simulate,
)
from bywire.simulation.schedule import Schedule
from bywire.simulation.variations import Variations, case_matrix

if TYPE_CHECKING:
    from bywire.simulation.program import Program

PAIRED = 32
"""cases from which on kernels may carry on two vectors in turn: with fewer, lanes would be idle"""


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


@dataclass(frozen=True)
class Ends:
    """Where the signals recorded at both ends of the rows alone go.

    Parameters
    ----------
    values
        Shape (signals, cases, 2), those of a signal in one piece.
    frames
        Those of the first and the last row.
    """

    values: Array
    frames: tuple[int, int]


class LaneKernel:
    """Compiled kernel for a group of cases, of the signals that are wanted and nothing else.

    ``signals``: how many outputs it records; ``ends``: how many of them, the last ones, at both
    ends of the rows alone.
    """

    ENTRY = "bw_run_lanes"
    """its function in the library"""

    def __init__(
        self, layout: Layout, library: Path, compiler: Compiler, signals: int, ends: int = 0
    ) -> None:
        self.layout, self.library, self.compiler = layout, library, compiler
        self._signals, self.ends = signals - ends, ends
        loaded = load(library, self.ENTRY)
        self.lanes = int(loaded.bw_lanes())
        self.label = f"compiled C in {self.lanes} lanes, {compiler.label}"
        self._run = loaded[self.ENTRY]
        self._run.restype = None

    @classmethod
    def of(
        cls, program: Program, compiler: Compiler, selection: tuple[int, ...], in_pairs: bool,
        ends: int = 0,
    ) -> LaneKernel:  # fmt: skip
        """Emit the kernel of a program, and compile it unless the cache has it.

        ``in_pairs``: whether there are cases enough for two vectors, should they pay; ``ends``: see
        `LaneKernel`.
        """
        from bywire.simulation.emission import layout_of
        from bywire.simulation.emit_lanes import emit_lanes, takes_turns
        from bywire.simulation.stages import build_stages

        stages = build_stages(program, outputs=selection)
        in_turn = in_pairs and takes_turns(stages)
        flags = IN_TURN if in_turn else VECTOR
        _, library = load_library(
            emit_lanes(stages, in_turn, ends), flags, compiler, cls.ENTRY
        )
        return cls(layout_of(stages), library, compiler, len(selection), ends)

    def advance(
        self,
        schedule: Schedule,
        parameters: Array,
        stimulus: Array,
        vector: Array,
        rows: Array,
        end: int,
        begin: int = 0,
        ends: Ends | None = None,
    ) -> None:
        """Run frames begin..end of one group; renews ``vector`` and fills ``rows``.

        Parameters
        ----------
        parameters
            Shape (np, lanes).
        stimulus
            Shape (rows, nu) shared by all lanes, or (rows, nu, lanes).
        vector
            State vectors, shape (entries, lanes).
        rows
            Shape (cases, recorded rows of these frames, signals), of any strides; lanes beyond
            the cases are not recorded.
        ends
            Where the signals recorded at both ends alone go; None of a kernel without any, and
            where no row is an end.
        """
        own = stimulus.ndim == 3
        apart = [stride // rows.itemsize for stride in rows.strides]
        at = (-1, -1, 0) if ends is None else (*ends.frames, ends.values.strides[0] // 8)
        plan = np.concatenate(
            (plan_array(schedule, begin, end, self._signals), [int(own), len(rows), *apart, *at])
        ).astype(np.int64)
        self._run(
            pointer(parameters),
            ctypes.c_double(schedule.step),
            pointer(stimulus),
            pointer(vector),
            pointer(plan),
            ctypes.c_void_p(rows.ctypes.data),
            ctypes.c_void_p(None if ends is None else ends.values.ctypes.data),
        )


def simulate_ensemble(
    run: Run,
    variations: Variations,
    signals: Sequence[str],
    threads: int | None = None,
) -> Ensemble:
    """Compute one run for many values of its parameters.

    Parameters
    ----------
    run
        Model, parameters, initial values, stimulus, steps.
    variations
        Dotted name of a parameter -> its value in each case, shape (cases,). What is not named
        keeps its value. Sample times cannot vary. All cases start from the state and memory of
        ``run``: where a varied parameter moves the equilibrium, let the run settle first.
    signals
        Outputs to record.
    threads
        Threads to use, >= 1; all cores by default.

    Returns
    -------
    Ensemble
        Times [s], shape (samples,), and each signal in its SI unit, shape (cases, samples).

    Raises
    ------
    UnknownNameError
        When a parameter or a signal is unknown.
    SolverError
        When a trajectory leaves the numbers.
    ParameterError
        When a value is out of range, lengths differ, or a sample time varies.
    """
    prepared = prepare(run.model, run.par)
    if threads is not None and threads < 1:
        raise ParameterError(f"threads = {threads} is not admissible: it must be >= 1")
    matrix = case_matrix(run, variations)
    compiler = find_compiler()
    if compiler is None:
        return _one_by_one(run, variations, tuple(signals))
    selection = selected(tuple(prepared.outputs), signals)
    count = matrix.shape[1]
    kernel = lane_kernel(prepared, compiler, tuple(selection.tolist()), count >= PAIRED)
    schedule = run.schedule()
    stimulus = sampled_stimulus(run, schedule)
    padded = -(-count // kernel.lanes) * kernel.lanes
    values = np.empty((padded, schedule.rows, len(signals)))
    counters = np.zeros((2, padded))
    start = initial_vector(kernel.layout, run.state, run.memory)

    def group(first: int) -> None:
        cases = np.arange(first, first + kernel.lanes)
        vector = np.repeat(start[:, None], kernel.lanes, axis=1)
        # Lanes beyond the last case repeat it.
        columns = np.ascontiguousarray(matrix[:, np.minimum(cases, count - 1)])
        rows = values[cases[0] : cases[-1] + 1]
        kernel.advance(schedule, columns, stimulus, vector, rows, schedule.frames)
        last = min(cases[-1], count - 1)
        require_finite(kernel.layout, vector, f"one of cases {first} to {last} left the numbers")
        counters[:, cases] = vector[kernel.layout.start["counters"] :]

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        list(pool.map(group, range(0, padded, kernel.lanes)))
    return Ensemble(
        time=schedule.record_times,
        values=values[:count],
        names=tuple(signals),
        unsettled=counters[0, :count].astype(np.int64),
        repeated=counters[1, :count].astype(np.int64),
        engine=kernel.label,
    )


@built_once
def lane_kernel(
    prepared: Prepared, compiler: Compiler, selection: tuple[int, ...], in_pairs: bool = False,
    ends: int = 0,
) -> LaneKernel:  # fmt: skip
    """Return the kernel that records some outputs, by index; built once.

    What an earlier command kept is taken as it is. ``in_pairs``, ``ends``: see `LaneKernel.of`.
    """
    place = None if prepared.place is None else prepared.place.in_lanes(selection, in_pairs, ends)
    kept = None if place is None else place.kept()
    if kept is not None and kept.library is not None and kept.compiler == compiler.label:
        return LaneKernel(kept.layout, kept.library, compiler, len(selection), ends)
    kernel = LaneKernel.of(prepared.program, compiler, selection, in_pairs, ends)
    if place is not None:
        place.keep(kernel)
        prepared.keep_model()
    return kernel


def _one_by_one(run: Run, variations: Variations, signals: tuple[str, ...]) -> Ensemble:
    """Serve without a compiler: the cases one after the other."""
    arrays = {name: np.atleast_1d(values) for name, values in variations.items()}
    count = next(iter(arrays.values())).size
    runs = [
        simulate(
            replace(run, par=run.par.replace({n: float(v[k]) for n, v in arrays.items()})), signals
        )
        for k in range(count)
    ]
    return Ensemble(
        time=runs[0].time,
        values=np.array([r.values for r in runs]),
        names=signals,
        unsettled=np.array([r.unsettled for r in runs]),
        repeated=np.array([r.repeated for r in runs]),
        engine=runs[0].engine,
    )
