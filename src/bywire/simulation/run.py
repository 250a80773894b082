"""Run of a model: its trajectory for initial values and a stimulus."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet, leaf_table
from bywire.core.signals import ranges_of, signals_of
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.simulation.advance import (
    Change,
    Progress,
    advance_all,
    energies,
    energy_of,
    pieces,
    put_in_signals,
    work_of,
)
from bywire.simulation.contacts import unresolved
from bywire.simulation.engine import Engine, prepare
from bywire.simulation.native import BufferedCall, Request
from bywire.simulation.noise import Noise
from bywire.simulation.schedule import Layout, Schedule, plan

Status = Literal["done", "interrupted", "unsettled"]


@dataclass(frozen=True)
class Run:
    """Definition of a run of a model.

    Parameters
    ----------
    model, par
        The system and its parameters.
    state, memory
        Initial values: the model's State and Memory.
    stimulus
        ``stimulus(t) -> array``: rows of the model's Stimulus at the times t, shape (len(t), nu).
    duration, step, record
        Length of the run, substep and recording interval [s].
    changes
        Changes of parameters at certain times, in order of time; see `Change`.
    most_work
        Work limit in substeps. A run that exceeds it fails; see `Trajectory.work`.
    """

    model: Model
    par: ParameterSet
    state: Any
    memory: Any
    stimulus: Callable[[Array], Array]
    duration: float
    step: float = 20e-6
    record: float = 1e-3
    changes: tuple[Change, ...] = ()
    most_work: float = math.inf

    def schedule(self) -> Schedule:
        """Return the run's schedule in integer multiples of the step."""
        return self._schedule

    @cached_property
    def _schedule(self) -> Schedule:
        periods = {task.name: task.period for task in self.model.tasks(self.par)}
        return plan(self.duration, self.step, periods, self.record)


@dataclass(frozen=True)
class Trajectory:
    """Trajectory of a run.

    Parameters
    ----------
    run
        The run.
    time, values
        Shapes (rows,) and (rows, signals).
    names
        Names of the signals, in the order of the columns.
    status
        ``done``, ``unsettled`` if some substeps reached the limit of the contact iteration, or
        ``interrupted`` if the user stopped the run (the rows then end early).
    unsettled, repeated
        Number of substeps that reached the iteration limit, and that took more than one pass.
    work
        Computing effort in ordinary substeps, which is the same on every machine.
    vector
        State vector at the end.
    """

    run: Run
    time: Array
    values: Array
    names: tuple[str, ...]
    status: Status
    unsettled: int
    repeated: int
    work: float
    engine: str
    vector: Array

    @cached_property
    def doubt(self) -> str:
        """Reason why the result may be wrong although all substeps settled; empty if none."""
        run = self.run
        return contact_doubts(run, [run.state], [run.memory], leaf_table([run.par]))[0]

    def __getitem__(self, name: str) -> Array:
        """Return one signal, shape (rows,)."""
        return np.asarray(self.values[:, self.names.index(name)])


def initial_vector(layout: Layout, state: Sequence[float], memory: Sequence[float]) -> Array:
    """Return the engine's state vector at the start of a run, shape (entries,)."""
    return np.asarray(initial_vectors(layout, [state], [memory])[0])


def initial_vectors(
    layout: Layout, states: Sequence[Any] | Array, memories: Sequence[Any] | Array
) -> Array:
    """Return the state vectors at the start of several runs, shape (runs, entries)."""
    vectors = np.zeros((len(states), layout.total))
    for kind, values in (("x", np.array(states)), ("m", np.array(memories))):
        vectors[:, layout.start[kind] :][:, : values.shape[1]] = values
    return vectors


def request_for(run: Run, signals: Sequence[str] | None = None) -> Request:
    """Return a run's request to a kernel; by default, it records all outputs."""
    names = tuple(prepare(run.model, run.par).outputs)
    schedule = run.schedule()
    return Request(
        schedule=schedule,
        parameters=np.array(list(run.par.leaves().values())),
        stimulus=sampled_stimulus(run, schedule),
        selection=selected(names, names if signals is None else signals),
    )


@checked
def simulate(
    run: Run,
    signals: Sequence[str] | None = None,
    engine: str = "auto",
    progress: Progress | None = None,
) -> Trajectory:
    """Compute one run.

    Parameters
    ----------
    run
        Model, parameters, initial values, stimulus, steps.
    signals
        Outputs to record. Default: all.
    engine
        See ``engine.Prepared.engine``.
    progress
        Called periodically with the finished fraction, 0 to 1.

    Returns
    -------
    Trajectory
        Times [s], shape (samples,), and each signal in its SI unit, of the same shape.

    Raises
    ------
    StepError
        When steps and sample times do not divide each other.
    SolverError
        When a value of the trajectory is infinite or NaN.
    WorkLimitError
        When the run exceeds its work limit.
    ParameterError
        When the stimulus is not finite.
    UnknownNameError
        When a signal is unknown.
    """
    prepared = prepare(run.model, run.par)
    chosen = prepared.engine(engine)
    names = tuple(prepared.outputs) if signals is None else tuple(signals)
    request = request_for(run, names)
    schedule = request.schedule
    vector = initial_vector(chosen.layout, run.state, run.memory)
    values = np.empty((schedule.rows, len(names)))
    if run.changes:
        finished, put_in = _advanced_in_pieces(run, engine, request, vector, values, progress)
        names = (*names, *put_in_signals(run.model.Output))
        values = np.column_stack((values, put_in))
    else:
        finished = advance_all(chosen, request, vector, values, progress, most=run.most_work)
    rows = schedule.rows if finished == schedule.frames else -(-finished // schedule.record_frames)
    counters = vector[chosen.layout.start["counters"] :]
    status: Status = "done" if finished == schedule.frames else "interrupted"
    if status == "done" and counters[0]:
        status = "unsettled"
    return Trajectory(
        run=run,
        time=schedule.record_times[:rows],
        values=values[:rows],
        names=names,
        status=status,
        unsettled=int(counters[0]),
        repeated=int(counters[1]),
        work=float(work_of(schedule, chosen.layout, finished, vector)),
        engine=chosen.label,
        vector=vector,
    )


def _advanced_in_pieces(
    run: Run, kind: str, request: Request, vector: Array, values: Array, progress: Progress | None
) -> tuple[int, Array]:
    """Advance a run with changes; return the finished frames and the energy of the changes.

    Raises
    ------
    ParameterError
        When a change alters the sample times or the model's state variables.
    """
    schedule, books = request.schedule, put_in_signals(run.model.Output)
    put_in = np.zeros((schedule.rows, len(books)))
    before: tuple[Engine, Request] | None = None
    finished = 0
    for begin, last, par in pieces(run.par, run.changes, schedule):
        prepared = prepare(run.model, par)
        engine = prepared.engine(kind)
        is_planned = replace(run, par=par, changes=()).schedule() == schedule
        if not is_planned or engine.layout.total != vector.size:
            what = "the model's state variables" if is_planned else "a sample time"
            raise ParameterError(
                f"a change during the run alters {what}. It may alter only values and laws",
                name="changes",
            )
        here = replace(request, parameters=np.array(list(par.leaves().values())))
        places = energies(run.model.Output, tuple(prepared.outputs))
        if before is not None and places.size:
            jump = energy_of(engine, here, vector, places) - energy_of(*before, vector, places)
            put_in[-(-begin // schedule.record_frames) :] += jump
        row = -(-begin // schedule.record_frames)
        rows = values[row:]
        finished = advance_all(engine, here, vector, rows, progress, begin, last, run.most_work)
        if finished < last:
            break
        before = engine, here
    return finished, put_in


def contact_doubts(
    run: Run, states: Sequence[Any] | Array, memories: Sequence[Any] | Array, table: Array
) -> list[str]:
    """Return why the step may be too long for each run's contacts, judged at the run's start.

    Parameters
    ----------
    run
        One of several runs with the same structure and step.
    states, memories
        Initial values of each run, shape (runs, entries) each.
    table
        Numbers of their parameter sets, shape (runs, leaves).
    """
    count = len(table)
    if not run.model.compliance(run.par):
        return [""] * count
    jacobians = prepare(run.model, run.par).contact_jacobians
    patterns = [jacobians.sparsity_out(k) for k in range(jacobians.n_out())]
    computed = BufferedCall(_mapped(jacobians, count))
    given = (np.ravel(np.asarray(each, dtype=float)) for each in (states, memories, table))
    entries = (each.reshape(count, -1) for each in computed(*given))
    opened, *closed = map(_matrices, patterns, entries)
    return unresolved(opened, closed, run.step)


@lru_cache(maxsize=16)
def _mapped(function: Any, count: int) -> Any:
    """Return a CasADi function of the arguments of several runs at a time."""
    return function.map(count) if count > 1 else function


def _matrices(pattern: Any, entries: Array) -> Array:
    """Return square matrices from the entries of a common pattern, shape (count, size, size)."""
    rows, columns = pattern.get_triplet()
    matrices = np.zeros((len(entries), *pattern.shape))
    matrices[:, rows, columns] = entries
    return matrices


def sampled_stimulus(run: Run, schedule: Schedule) -> Array:
    """Return a run's stimulus rows, shape (rows, nu).

    Raises
    ------
    ParameterError
        When a value is not finite or is outside the signal's range.
    """
    rows = np.ascontiguousarray(run.stimulus(schedule.stimulus_times), dtype=np.float64)
    is_finite = np.isfinite(rows)
    if not is_finite.all():
        row, signal = np.argwhere(~is_finite)[0]
        raise ParameterError(
            f"the stimulus {run.model.Stimulus._fields[signal]} is {rows[row, signal]} at "
            f"t = {schedule.stimulus_times[row]:g} s, but it must be finite throughout the run",
            name=run.model.Stimulus._fields[signal],
            value=str(rows[row, signal]),
            valid="finite",
        )
    for signal, low, high in stimulus_ranges(run.model):
        outside = (rows[:, signal] < low) | (rows[:, signal] > high)
        if outside.any():
            row = int(np.argmax(outside))
            name = run.model.Stimulus._fields[signal]
            unit = signals_of(run.model.Stimulus)[name].unit
            ends = [f">= {shown(low, unit)}"] * (low > -np.inf)
            ends += [f"<= {shown(high, unit)}"] * (high < np.inf)
            raise ParameterError(
                f"the stimulus {name} is {shown(rows[row, signal], unit)} at "
                f"t = {schedule.stimulus_times[row]:g} s, but it must be {' and '.join(ends)}",
                name=name,
                value=shown(rows[row, signal], unit),
                valid=" and ".join(ends),
            )
    return rows


def stimulus_ranges(model: Model) -> list[tuple[int, float, float]]:
    """Return index and range of each stimulus with a declared range."""
    fields = model.Stimulus._fields
    return [(fields.index(n), *ends) for n, ends in ranges_of(model.Stimulus).items()]


def put_signals(rows: Array, run: Run, t: Array) -> Noise | None:
    """Write a run's stimulus at times [s] to rows of zeros, shape (len(t), nu).

    A stimulus with a method ``put_into(rows, t)`` may skip signals that are zero. Its attribute
    ``noise`` describes the noise that this method leaves out, and that this function returns.
    """
    put = getattr(run.stimulus, "put_into", None)
    if put is None:
        rows[:] = run.stimulus(t)
        return None
    put(rows, t)
    noise: Noise = getattr(run.stimulus, "noise")  # noqa: B009 - not every stimulus has it
    return noise if noise.columns else None


def selected(names: Sequence[str], signals: Sequence[str]) -> NDArray[np.int32]:
    """Return the indices of signals in the list of outputs.

    Raises
    ------
    UnknownNameError
        When a signal is unknown. The message contains the nearest valid names.
    """
    for signal in signals:
        if signal not in names:
            raise unknown_name("signal", signal, names)
    return np.array([names.index(s) for s in signals], dtype=np.int32)
