"""Exact forward sensitivities of a run with respect to its parameters."""

from __future__ import annotations

import ctypes
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bywire.core.arguments import checked
from bywire.core.errors import CompilerError, ParameterError, unknown_name
from bywire.core.typing import Array
from bywire.simulation.advance import require_finite, require_unchanged, work_of
from bywire.simulation.compiler import VECTOR, Compiler, find_compiler, load_library
from bywire.simulation.emit_tangents import emit_tangents
from bywire.simulation.engine import built_once, prepare
from bywire.simulation.expressions import needed
from bywire.simulation.native import Request, plan_array, pointer, rows_pointer, run_in_calls
from bywire.simulation.program import Program
from bywire.simulation.run import (
    Run,
    Trajectory,
    initial_vector,
    sampled_stimulus,
    selected,
)
from bywire.simulation.schedule import Layout
from bywire.simulation.stages import Stages, build_stages, layout_of

DIRECTIONS = 8
_CHUNK = 5_000  # substeps per call of the kernel


def rounds(stages: Stages) -> bool:
    """Return whether a sampled value of the plant is rounded, for example by a converter."""
    graph = stages.graph
    moving = stages.varies(frozenset({"x"}))
    order = needed(graph, [n for task in stages.ticks for n in task], lambda _: False)
    return any(graph.nodes[n].op == "floor" and moving[graph.nodes[n].args[0]] for n in order)


@dataclass(frozen=True)
class Sensitivity:
    """A trajectory and its derivatives.

    Parameters
    ----------
    trajectory
        The run itself.
    derivatives
        d(signal)/d(parameter), shape (rows, signals, parameters), in SI units.
    parameters
        Names of the directions, in the order of the last axis: parameters, ``initial.STATE``,
        ``stimulus.NAME``.
    """

    trajectory: Trajectory
    derivatives: Array
    parameters: tuple[str, ...]

    def of(self, signal: str, parameter: str) -> Array:
        """Return one derivative as a function of time, shape (rows,)."""
        s = self.trajectory.names.index(signal)
        return np.asarray(self.derivatives[:, s, self.parameters.index(parameter)])


class TangentKernel:
    """Compiled kernel for one run with eight directions at a time."""

    def __init__(self, program: Program, directions: tuple[int, ...], compiler: Compiler) -> None:
        stages = build_stages(program, directions)
        self.layout: Layout = layout_of(stages)
        self.label = f"compiled C with tangents, {compiler.label}"
        source = emit_tangents(stages, DIRECTIONS)
        entry = "bw_run_tangents"
        library, _ = load_library(source, VECTOR, compiler, entry)
        self._run = library[entry]
        self._run.restype = ctypes.c_int64
        self.rounds = rounds(stages)

    def advance(
        self,
        request: Request,
        state: Array,
        begin: int,
        end: int,
        rows: Array,
        seeds: Array,
        tangents: Array,
        rows_t: Array,
    ) -> None:
        """Run the frames from begin to end; update all arrays in place.

        Parameters
        ----------
        seeds
            Changes in each direction, shape (seeded parameters and stimuli, directions).
        tangents
            Derivatives of the state vector, shape (entries, directions).
        rows_t
            Derivatives of the rows, shape (rows, signals, directions).
        """
        step = ctypes.c_double(request.schedule.step)
        inputs = (pointer(request.parameters), step, pointer(request.stimulus), pointer(state))
        selection = pointer(request.selection)
        directions = (pointer(seeds), pointer(tangents))
        row_at, row_t_at = rows_pointer(rows), rows_pointer(rows_t)

        def call(first: int, last: int, row: int) -> int:
            plan = plan_array(request.schedule, first, last, request.selection.size)
            return int(
                self._run(
                    *inputs, pointer(plan), selection, row_at(row), *directions, row_t_at(row)
                )
            )

        run_in_calls(request.schedule, begin, end, call, _CHUNK)


@checked
def simulate_with_sensitivities(
    run: Run,
    parameters: Sequence[str],
    signals: Sequence[str],
    initial: Array | None = None,
    memory: Array | None = None,
) -> Sensitivity:
    """Compute a run and the derivatives of its signals.

    A direction may also be an initial state, such as ``initial.omega``, or a constant that is added
    to a stimulus, such as ``stimulus.i_set``. Any other direction, such as ``start.p``, acts only
    through the derivatives of the initial values.

    The derivatives are exact for the computed run. They use forward differentiation of every
    substep, including friction and contact decisions. With stick-slip, the time of a breakaway
    moves with the parameters only as finely as sampled inputs change. In this case, let tasks and
    ideal sources tick at every step. The first slips of a ramp are then within 2 % at 20 us. When a
    body reverses or stops, the substep is cut at that time, which moves with the parameters.

    Parameters
    ----------
    run
        Model, parameters, initial values, stimulus, steps.
    parameters
        Dotted names of the parameters and of other directions.
    signals
        Outputs to record.
    initial
        Derivatives of the initial state with respect to the parameters, shape
        (states, parameters). Default: zero.
    memory
        Derivatives of the initial memory, shape (memories, parameters).

    Returns
    -------
    Sensitivity
        The run's signals in SI units, and their derivatives in each direction, in the signal's unit
        divided by the direction's unit.

    Raises
    ------
    UnknownNameError
        When a parameter or a signal is unknown.
    SolverError
        When a value of the trajectory is infinite or NaN.
    CompilerError
        When there is no compiler.
    """
    if not parameters:
        raise ParameterError(
            "sensitivities need at least one parameter",
            name="parameters",
            valid="at least one parameter",
        )
    require_unchanged(run.changes, "sensitivities")
    prepared = prepare(run.model, run.par)
    model, known = run.model, tuple(prepared.program.parameter_names)
    fields = (model.State._fields, model.Stimulus._fields)
    directions = _directions(*fields, tuple(parameters), known)
    _require_shape("initial", initial, (len(run.state), len(parameters)))
    _require_shape("memory", memory, (len(run.memory), len(parameters)))
    from_start = directions.initial + (0.0 if initial is None else initial)
    compiler = find_compiler()
    if compiler is None:
        raise CompilerError(
            "sensitivities need a C compiler. Install the extra bywire[compiler]",
            valid="bywire[compiler]",
        )
    kernel = _tangent_kernel(prepared.program, directions.indices, compiler)
    if kernel.rounds:
        warnings.warn(
            "a sampled value is rounded to whole codes. Its derivatives are therefore zero, and "
            "closed loops look open. Choose the law without rounding (adc.law = 'ideal')",
            stacklevel=2,
        )
    schedule = run.schedule()
    stimulus = sampled_stimulus(run, schedule)
    outputs = tuple(prepared.program.outputs)
    selection = selected(outputs, signals)
    values = np.empty((schedule.rows, selection.size))
    count = len(parameters)
    derivatives = np.empty((schedule.rows, selection.size, count))
    request = Request(schedule, np.array(list(run.par.leaves().values())), stimulus, selection)
    for first in range(0, count, DIRECTIONS):
        here = min(DIRECTIONS, count - first)
        vector = initial_vector(kernel.layout, run.state, run.memory)
        lanes = slice(first, first + here)
        seeds = np.zeros((len(directions.seeds), DIRECTIONS))
        tangents = np.zeros((vector.size, DIRECTIONS))
        seeds[:, :here] = directions.seeds[:, lanes]
        tangents[: len(from_start), :here] = from_start[:, lanes]
        if memory is not None:
            at = kernel.layout.start["m"]
            tangents[at : at + len(memory), :here] = memory[:, lanes]
        rec_t = np.empty((schedule.rows, selection.size, DIRECTIONS))
        kernel.advance(request, vector, 0, schedule.frames, values, seeds, tangents, rec_t)
        require_finite(kernel.layout, vector, "the run diverged")
        derivatives[:, :, first : first + here] = rec_t[:, :, :here]
    counters = vector[kernel.layout.start["counters"] :]
    trajectory = Trajectory(
        run=run,
        time=schedule.record_times,
        values=values,
        names=tuple(signals),
        status="unsettled" if counters[0] else "done",
        unsettled=int(counters[0]),
        repeated=int(counters[1]),
        work=float(work_of(schedule, kernel.layout, schedule.frames, vector)),
        engine=kernel.label,
        vector=vector,
    )
    return Sensitivity(trajectory, derivatives, tuple(parameters))


def _require_shape(name: str, given: Array | None, shape: tuple[int, int]) -> None:
    if given is not None and np.shape(given) != shape:
        raise ParameterError(
            f"{name} has the shape {np.shape(given)}, but it must be {shape}, rows and parameters",
            name=name,
            value=str(np.shape(given)),
            valid=str(shape),
        )


@dataclass(frozen=True)
class _Directions:
    """Changes of initial values, parameters and stimuli in each direction.

    Parameters
    ----------
    indices
        Indices of the parameters with seeds in the kernel.
    seeds
        Shape (seeded parameters and stimuli, directions).
    initial
        Shape (states, directions).
    """

    indices: tuple[int, ...]
    seeds: Array
    initial: Array


@lru_cache(maxsize=64)  # a fit requests the same directions for every run
def _directions(
    state: tuple[str, ...],
    stimulus: tuple[str, ...],
    requested: tuple[str, ...],
    known: tuple[str, ...],
) -> _Directions:
    states = [f"initial.{name}" for name in state]
    stimuli = [f"stimulus.{name}" for name in stimulus]
    for name in requested:
        if name not in (*known, *states, *stimuli) and not name.startswith("start."):
            raise unknown_name("parameter", name, (*known, *states, *stimuli))
    own = [name for name in requested if name in known] or [known[0]]  # a kernel needs at least one
    seeded = [*own, *stimuli]
    seeds = np.array([[float(row == name) for name in requested] for row in seeded])
    initial = np.array([[float(row == name) for name in requested] for row in states])
    return _Directions(tuple(known.index(name) for name in own), seeds, initial)


@built_once
def _tangent_kernel(
    program: Program, directions: tuple[int, ...], compiler: Compiler
) -> TangentKernel:
    return TangentKernel(program, directions, compiler)
