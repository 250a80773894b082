"""Many cases of one model, side by side in lanes on all cores, or on a graphics processor.

An ensemble varies parameters of one run. In a group of runs, each run also has its own initial
values and stimulus. An example is a bench whose equilibrium or set point depends on the varied
parameters.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError, not_valid, unknown_name
from bywire.core.interrupts import thread_pool
from bywire.core.on_demand import OnDemand
from bywire.core.parameters import ParameterSet, leaf_table
from bywire.core.typing import Array
from bywire.simulation.advance import (
    energies,
    pieces,
    put_in_signals,
    require_finite,
    require_unchanged,
    require_work,
    work_of,
)
from bywire.simulation.case_kernels import CaseKernel, case_kernel, is_side_by_side
from bywire.simulation.engine import CUDA, are_alike, prepare
from bywire.simulation.native import Ends, Inputs
from bywire.simulation.noise import Noise, put_noises
from bywire.simulation.run import (
    Run,
    Trajectory,
    initial_vector,
    initial_vectors,
    put_signals,
    sampled_stimulus,
    selected,
    simulate,
    stimulus_ranges,
)
from bywire.simulation.run_table import RunTable, change, one_of
from bywire.simulation.schedule import COUNTERS, Schedule

if TYPE_CHECKING:
    from bywire.simulation.cuda import HeldRows

# Maximum number of intervals of a run, and minimum number of substeps per interval. Between
# intervals, the run reports progress and handles interrupts, which takes as long as a hundred
# substeps.
_CHUNKS, _SUBSTEPS = 20, 20_000
# A graphics processor fetches the rows of an interval at its end, and checks for interrupts more
# often.
_CUDA_SUBSTEPS = 200_000


def fit_lanes(runs: Sequence[Run], engine: str = "auto") -> bool:
    """Return whether runs can be computed side by side.

    This needs a compiler, one structure and one plan. ``engine``: see
    `bywire.simulation.ensemble.simulate_ensemble`.
    """
    if not is_side_by_side(engine) or not runs:
        return False
    if isinstance(runs, RunTable):
        return True
    first, schedule = runs[0], runs[0].schedule()
    return all(
        are_alike(each.model, each.par, first.model, first.par) and each.schedule() == schedule
        for run in runs
        for each in (run, *(replace(run, par=change.par, changes=()) for change in run.changes))
    )


@dataclass(frozen=True)
class RunGroup(Sequence[Trajectory]):
    """Trajectories of runs that were computed side by side.

    Parameters
    ----------
    runs
        The runs.
    time
        Times of the rows [s], shape (rows,).
    values
        Signals, each contiguous over all runs, shape (signals, runs, rows). If runs have changes
        and the stored energy is recorded, the last signal is the work of the changes. Rows that a
        graphics processor holds are fetched on first use.
    names
        Names of the signals, in the order of the first axis.
    vectors
        State vectors at the end, shape (entries, runs).
    kernel
        Kernel that computed them.
    ends, end_names
        Signals that are recorded only in the first and last rows, shape (signals, runs, 2), and
        their names.
    """

    runs: Sequence[Run]
    time: Array
    values: Array | HeldRows
    names: tuple[str, ...]
    vectors: Array
    kernel: CaseKernel
    ends: Array
    end_names: tuple[str, ...] = ()

    @property
    def unsettled(self) -> NDArray[np.int64]:
        """Substeps of each run that hit the contact iteration's limit, shape (runs,)."""
        return np.asarray(self.vectors[self.kernel.layout.start["counters"]], dtype=np.int64)

    @property
    def signals(self) -> Mapping[str, Array]:
        """Signals by name, shape (runs, rows)."""
        if isinstance(self.values, np.ndarray):
            return dict(zip(self.names, self.values, strict=True))
        signal, places = self.values.signal, {name: k for k, name in enumerate(self.names)}
        return OnDemand(places, lambda name: signal(places[name]))

    @property
    def edges(self) -> Mapping[str, Array]:
        """First and last row of each signal by name, shape (runs, 2)."""
        if isinstance(self.values, np.ndarray):
            both = self.values[:, :, [0, -1]]
        else:
            both = self.values.extremes[:, :, [0, -1]]
        return dict(zip(self.names, both, strict=True))

    @property
    def held(self) -> HeldRows | None:
        """The rows that a graphics processor holds; None for an array."""
        return None if isinstance(self.values, np.ndarray) else self.values

    def close(self) -> None:
        """Free rows that a graphics processor holds, which can no longer be fetched."""
        if not isinstance(self.values, np.ndarray):
            self.values.close()

    def __len__(self) -> int:
        return len(self.runs)

    @overload
    def __getitem__(self, k: int) -> Trajectory: ...

    @overload
    def __getitem__(self, k: slice) -> tuple[Trajectory, ...]: ...

    def __getitem__(self, k: int | slice) -> Trajectory | tuple[Trajectory, ...]:
        if isinstance(k, slice):
            return tuple(self)[k]
        layout, schedule, vector = self.kernel.layout, self.runs[k].schedule(), self.vectors[:, k]
        unsettled, repeated = (int(n) for n in vector[layout.start["counters"] :][:2])
        return Trajectory(
            run=self.runs[k],
            time=self.time,
            values=self.values[:, k].T,
            names=self.names,
            status="unsettled" if unsettled else "done",
            unsettled=unsettled,
            repeated=repeated,
            work=float(work_of(schedule, layout, schedule.frames, vector)),
            engine=self.kernel.label,
            vector=vector.copy(),
        )


def simulate_group(
    runs: Sequence[Run],
    signals: Sequence[str] | None = None,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    first: int = 0,
    engine: str = "auto",
    ends: Sequence[str] = (),
    hold: bool = False,
) -> RunGroup:
    """Compute runs side by side, each with its own parameters, initial values and stimulus.

    Parameters
    ----------
    runs
        Runs of one model with the same duration, step, recording interval and sample times; see
        `fit_lanes`.
    signals
        Outputs to record. Default: all.
    threads
        Threads to use, >= 1. Default: one per core.
    progress
        Called periodically with the finished fraction, 0 to 1.
    first
        Number of initial rows that are not recorded, such as the rows of a settling phase.
    engine
        ``auto`` and ``compiled`` compute the runs in lanes, ``cuda`` on a graphics processor.
    ends
        Additional outputs to record only in the first and last rows. This requires runs without
        changes.
    hold
        Whether a graphics processor may hold the rows until they are read; see `RunGroup.close`.

    Raises
    ------
    ParameterError
        When the runs do not match, or a stimulus is not finite.
    UnknownNameError
        When a signal is unknown.
    SolverError
        When a value of a trajectory is infinite or NaN.
    WorkLimitError
        When a run exceeds its work limit.
    DeviceError
        For ``cuda`` without a graphics processor, or without enough memory on it.
    """
    if threads is not None and threads < 1:
        raise not_valid("threads", str(threads), ">= 1")
    if not fit_lanes(runs, engine):
        raise ParameterError(
            "these runs cannot be computed side by side. This requires a C compiler, and the same "
            "model, structure, duration, step, recording interval and sample times",
            name="runs",
        )
    one = one_of(runs)
    prepared = prepare(one.model, one.par)
    names = tuple(prepared.outputs)
    wanted = names if signals is None else tuple(signals)
    if ends and change(runs):
        raise ParameterError(
            "ends is not available for runs with changes, which record all rows. Omit ends",
            name="ends",
        )
    selection = tuple(selected(names, (*wanted, *ends)).tolist())
    schedule = one.schedule()
    kernel = case_kernel(prepared, engine, selection, len(runs), schedule, len(ends))
    edges = _edges(schedule, first, runs, _CUDA_SUBSTEPS if engine == CUDA else _SUBSTEPS)
    output = one.model.Output
    jumping = energies(output, wanted) if change(runs) else np.empty((0, 0))
    watch = _Watch(-(-len(runs) // kernel.lanes) * (len(edges) - 1), progress)
    recorded = (*wanted, *put_in_signals(output)) if jumping.any() else wanted
    shape = len(recorded), len(runs), schedule.rows - first
    held = kernel.hold(shape) if hold and not change(runs) else None
    values: Array | HeldRows = kernel.array(shape) if held is None else held
    if isinstance(values, np.ndarray):
        values[len(wanted) :] = 0.0  # sums up the work of changes
    at_ends = np.zeros((len(ends), len(runs), 2))
    frames = (first * schedule.record_frames, (schedule.rows - 1) * schedule.record_frames)

    room = _Room()

    def computed(begin: int) -> Array:
        cases = slice(begin, begin + kernel.lanes)
        carried = _Carried(kernel, schedule, runs[cases], jumping, room)
        apart = Ends(at_ends[:, cases], frames) if ends else None
        part = values[:, cases] if isinstance(values, np.ndarray) else values
        return carried.to_the_end(part, edges, first, watch, apart)

    with thread_pool(threads or kernel.at_once) as pool:
        vectors = list(pool.map(computed, range(0, len(runs), kernel.lanes)))
    vector = np.concatenate(vectors, axis=1)[:, : len(runs)]
    return RunGroup(
        runs if isinstance(runs, RunTable) else tuple(runs),
        schedule.record_times[first:],
        values,
        recorded,
        vector,
        kernel,
        at_ends,
        tuple(ends),
    )


def _edges(schedule: Schedule, first: int, runs: Sequence[Run], least: int) -> list[int]:
    """Return the frames at which the intervals of a run begin and end.

    They include the frame of the first recorded row and those of the runs' changes. ``least``:
    minimum number of substeps per interval.
    """
    every = schedule.record_frames
    count = min(_CHUNKS, schedule.frames * schedule.substeps // least + 1)
    rows = {*np.linspace(0, schedule.frames // every, count + 1).astype(int).tolist(), first}
    several = runs if change(runs) else ()
    changed = (pieces(run.par, run.changes, schedule) for run in several if run.changes)
    begins = {begin for stretches in changed for begin, _, _ in stretches}
    return sorted(begins.union(each * every for each in rows))


class _Watch:
    """Common progress of several threads."""

    def __init__(self, pieces: int, progress: Callable[[float], None] | None) -> None:
        self._pieces, self._done = pieces, 0
        self._progress, self._lock = progress, threading.Lock()

    def piece(self) -> None:
        with self._lock:
            self._done += 1
            if self._progress is not None:
                self._progress(self._done / self._pieces)


class _Room(threading.local):
    """Memory of a thread for the stimuli of one group of lanes after the other."""

    rows: Array | None = None


def _shared_stimuli(group: RunTable, kernel: CaseKernel, room: _Room) -> Array | Inputs:
    """Return stimulus rows as in `_stimuli`; for lanes, they are valid until the next group."""
    count, width, own = len(group), kernel.lanes, np.array(group.noisy, dtype=int)
    if kernel.shares_stimuli:
        inputs = Inputs.of(lambda _: np.ascontiguousarray(group.stimulus.T), 1, width)
        noise = _noise_rows(group.seeds, group.noisy, width, len(group.stimulus))
        return inputs.with_noise(noise)
    if not own.size:
        return group.stimulus
    if room.rows is None:
        room.rows = np.repeat(group.stimulus[:, :, None], width, axis=2)
    rows = room.rows
    put_noises(rows.transpose(2, 0, 1)[:count], group.seeds, group.noisy)
    if count < width:
        rows[:, own, count:] = rows[:, own, count - 1 : count]
    return rows


def _stimuli(group: Sequence[Run], schedule: Schedule, kernel: CaseKernel) -> Array | Inputs:
    """Return the runs' stimulus rows as a kernel reads them.

    For lanes, the shape is (rows, nu, lanes), or (rows, nu) if all are equal.
    """
    t, ranges = schedule.stimulus_times, stimulus_ranges(group[0].model)
    shape, width, count = (len(group[0].model.Stimulus._fields), t.size), kernel.lanes, len(group)

    def require_usual(signals: Array, runs: Sequence[Run]) -> None:
        is_usual = np.isfinite(signals).all() and all(
            (signals[:, k] >= low).all() and (signals[:, k] <= high).all()
            for k, low, high in ranges
        )
        if not is_usual:
            for run in runs:
                sampled_stimulus(run, schedule)  # raises an error with the signal and the time

    noises: dict[int, Noise] = {}

    def put(signals: Array, case: int) -> None:
        noise = put_signals(signals.T, group[case], t)
        if noise is not None:
            noises[case] = noise

    def rows_of(case: int) -> Array:
        signals = np.zeros(shape)
        put(signals, case)
        require_usual(signals[None], group[case : case + 1])
        return signals

    if kernel.shares_stimuli:
        inputs = Inputs.of(rows_of, count, width)
        noise = _noise_rows(*_seeds_of(noises), width, t.size) if noises else {}
        return inputs.with_noise(noise)
    signals = np.zeros((width, *shape))  # each contiguous
    for lane in range(count):
        put(signals[lane], lane)
    signals[count:] = signals[count - 1]
    require_usual(signals, group)
    if noises:
        rows = signals.transpose(2, 1, 0).copy()
        put_noises(rows.transpose(2, 0, 1)[:count], *_seeds_of(noises))
        rows[:, :, count:] = rows[:, :, count - 1 : count]
        return rows
    is_shared = all(np.array_equal(signals[0], other) for other in signals[1:])
    return (signals[0].T if is_shared else signals.transpose(2, 1, 0)).copy()


def _seeds_of(noises: Mapping[int, Noise]) -> tuple[NDArray[np.uint64], tuple[int, ...]]:
    """Return the seeds of runs of one model, shape (runs, numbers), and their noisy columns."""
    each = [noises[k] for k in range(len(noises))]
    return np.array([noise.seed for noise in each], dtype=np.uint64), each[0].columns


def _noise_rows(
    seeds: NDArray[np.uint64], columns: tuple[int, ...], width: int, samples: int
) -> dict[int, Array]:
    """Return the noise of all cases by column, shape (width, samples); idle ones repeat a case."""
    rows, count = np.empty((len(columns), width, samples)), len(seeds)
    put_noises(rows.transpose(1, 2, 0)[:count], seeds, range(len(columns)))
    rows[:, count:] = rows[:, count - 1 : count]
    return dict(zip(columns, rows, strict=True))


class _Carried:
    """Runs that advance side by side.

    ``jumping``: the signals that are energies and jump at changes, by balance; see `energies`.
    """

    def __init__(
        self,
        kernel: CaseKernel,
        schedule: Schedule,
        group: Sequence[Run],
        jumping: Array,
        room: _Room,
    ) -> None:
        self._kernel, self._schedule, self._jumping = kernel, schedule, jumping
        self._books = len(jumping) if jumping.any() else 0
        self._count, width = len(group), kernel.lanes
        self._changes: dict[int, list[tuple[int, ParameterSet]]] = {}
        if isinstance(group, RunTable):
            lanes = np.minimum(np.arange(width), self._count - 1)  # idle lanes repeat the last run
            vector = initial_vectors(kernel.layout, group.states[lanes], group.memories[lanes])
            self._vector = vector.T.copy()
            self._parameters = group.parameters[lanes].T.copy()
            self._stimulus = _shared_stimuli(group, kernel, room)
            self._most = np.full(width, group.like.most_work)
            return
        filled = [*group, *[group[-1]] * (width - len(group))]  # idle lanes repeat the last run
        states, memories = [run.state for run in filled], [run.memory for run in filled]
        self._vector = initial_vectors(kernel.layout, states, memories).T.copy()
        self._parameters = leaf_table([run.par for run in filled]).T.copy()
        for lane, run in enumerate(filled):
            for begin, _, par in pieces(run.par, run.changes, schedule) if run.changes else ():
                self._changes.setdefault(begin, []).append((lane, par))
        self._stimulus = _stimuli(group, schedule, kernel)
        self._most = np.array([run.most_work for run in filled])

    def to_the_end(
        self,
        values: Array | HeldRows,
        edges: Sequence[int],
        skipped: int,
        watch: _Watch,
        ends: Ends | None,
    ) -> Array:
        """Advance the runs to their end; fill ``values`` and return the state vectors."""
        schedule, every = self._schedule, self._schedule.record_frames
        silent = replace(schedule, record_frames=schedule.frames + 1)  # except for the first row
        for begin, end in pairwise(edges):
            first = -(-begin // every) - skipped
            if begin in self._changes and isinstance(values, np.ndarray):
                self._change(begin, values[:, :, max(first, 0) :])
            last = (schedule.rows if end == schedule.frames else -(-end // every)) - skipped
            signals = values.shape[0] - self._books
            if first >= 0 and not isinstance(values, np.ndarray):
                self._advance(schedule, values.window(first), begin, end, ends)
            elif first >= 0:
                rows = values[:signals, :, first : max(last, first + 1)].transpose(1, 2, 0)
                self._advance(schedule, rows, begin, end, ends)
            else:
                rows = np.empty((self._count, 1, signals))
                self._advance(silent, rows, begin, end)
            require_finite(
                self._kernel.layout,
                self._vector,
                f"one of {self._count} runs diverged before t = {end * schedule.frame:g} s",
            )
            require_work(work_of(schedule, self._kernel.layout, end, self._vector), self._most)
            watch.piece()
        return self._vector

    def _change(self, begin: int, rows: Array) -> None:
        """Set the parameters that apply from a frame, and record the work of the change."""
        here = self._changes[begin]
        before = self._energies(rows) if self._books and begin else None
        for lane, par in here:
            self._parameters[:, lane] = list(par.leaves().values())
        if before is not None:
            rows[-self._books :] += (self._energies(rows) - before)[:, : self._count, None]

    def _energies(self, rows: Array) -> Array:
        """Return the total energy of each balance in every lane [J], shape (balances, lanes)."""
        end, kept = self._schedule.frames, self._vector
        row = np.empty((self._kernel.lanes, 1, rows.shape[0] - self._books))
        self._vector = kept.copy()
        self._advance(self._schedule, row, end, end)
        self._vector = kept
        return np.array([row[:, 0, book > 0].sum(axis=-1) for book in self._jumping])

    def _advance(
        self, plan: Schedule, rows: Any, begin: int, end: int, ends: Ends | None = None
    ) -> None:
        self._kernel.advance(
            plan, self._parameters, self._stimulus, self._vector, rows, end, begin, ends
        )


# --- One run for many values of its parameters

Variations = Mapping[str, Array | Sequence[float]]


def case_matrix(run: Run, variations: Variations) -> Array:
    """Return the parameter vectors of all cases, shape (parameters, cases).

    The function checks the range of each value, the rules within a group of parameters for each
    case, and the rules across groups at the extremes of each parameter.

    Raises
    ------
    UnknownNameError
        When a parameter is unknown.
    ParameterError
        When a value is out of range, lengths differ, or a sample time varies.
    """
    require_unchanged(run.changes, "variations")
    names = list(run.par.leaves())
    arrays = {name: np.atleast_1d(np.asarray(v, dtype=float)) for name, v in variations.items()}
    for name in arrays:
        if name not in names:
            raise unknown_name("parameter", name, names)
    lengths = {name: array.size for name, array in arrays.items()}
    if not arrays or len(set(lengths.values())) != 1 or 0 in lengths.values():
        raise ParameterError(
            f"the lengths of variations are {lengths}, but all must be equal and >= 1",
            name="variations",
            value=str(lengths),
        )
    count = next(iter(lengths.values()))
    matrix = np.empty((len(names), count))
    matrix[:] = np.array(list(run.par.leaves().values()))[:, None]
    for name, array in arrays.items():
        _check_extremes(run, name, array)
        matrix[names.index(name)] = array
    for group in {name.partition(".")[0] for name in arrays}:
        _check_group(run.par, group, arrays, count)
    return matrix


def _check_extremes(run: Run, name: str, array: Array) -> None:
    values = [float(array.min()), float(array.max())]
    if not math.isfinite(float(array.sum())):
        values = [float(v) for v in array if not math.isfinite(v)][:1] or values
    periods = [task.period for task in run.model.tasks(run.par)]
    for value in values:
        changed = run.par.replace({name: value})
        if [task.period for task in run.model.tasks(changed)] != periods:
            raise ParameterError(
                f"{name} is a sample time, which an ensemble cannot vary", name=name
            )


def _check_group(par: ParameterSet, group: str, arrays: Mapping[str, Array], count: int) -> None:
    """Check the rules between the parameters of a group, if any, for each case."""
    node: Any = getattr(par, group)
    varied = {
        name.partition(".")[2]: v for name, v in arrays.items() if name.startswith(f"{group}.")
    }
    if len(varied) < 2 or not isinstance(node, ParameterSet) or not _has_rules(type(node)):
        return
    for k in range(count):
        try:
            node.replace({name: float(values[k]) for name, values in varied.items()})
        except ParameterError as error:
            raise error.reworded(f"case {k}: {error}") from None


def _has_rules(cls: type[ParameterSet]) -> bool:
    inner = (info.annotation for info in cls.model_fields.values())
    return bool(cls.__pydantic_decorators__.model_validators) or any(
        isinstance(kind, type) and issubclass(kind, ParameterSet) and _has_rules(kind)
        for kind in inner
    )


# --- The ensemble


@dataclass(frozen=True)
class Ensemble:
    """Results of an ensemble.

    Parameters
    ----------
    time, values
        Shapes (rows,) and (cases, rows, signals).
    names
        Names of the signals, in the order of the last axis.
    unsettled, repeated
        Number of substeps per case that reached the iteration limit, and that took more than one
        pass, shape (cases,).
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


def simulate_ensemble(
    run: Run,
    variations: Variations,
    signals: Sequence[str],
    threads: int | None = None,
    engine: str = "auto",
) -> Ensemble:
    """Compute one run for many values of its parameters.

    Parameters
    ----------
    run
        Model, parameters, initial values, stimulus, steps.
    variations
        Values of each varied parameter by dotted name, shape (cases,). Other parameters keep their
        values. Sample times cannot vary. All cases start from the state and memory of ``run``. If a
        varied parameter moves the equilibrium, let the run settle first.
    signals
        Outputs to record.
    threads
        Threads to use, >= 1. Default: one per core.
    engine
        ``auto`` and ``compiled`` compute the cases side by side in lanes, ``cuda`` on a graphics
        processor with one thread per case. Other engines, and ``auto`` without a compiler, compute
        the cases one by one.

    Returns
    -------
    Ensemble
        Times [s], shape (samples,), and each signal in its SI unit, shape (cases, samples).

    Raises
    ------
    UnknownNameError
        When a parameter, a signal or an engine is unknown.
    SolverError
        When a value of a trajectory is infinite or NaN.
    ParameterError
        When a value is out of range, lengths differ, or a sample time varies.
    CompilerError
        For ``compiled`` without a compiler.
    DeviceError
        For ``cuda`` without a graphics processor, or without enough memory on it.
    """
    prepared = prepare(run.model, run.par)
    if threads is not None and threads < 1:
        raise not_valid("threads", str(threads), ">= 1")
    matrix = case_matrix(run, variations)
    if not is_side_by_side(engine):
        return _one_by_one(run, variations, tuple(signals), engine)
    selection = tuple(selected(tuple(prepared.outputs), signals).tolist())
    count, schedule = matrix.shape[1], run.schedule()
    kernel = case_kernel(prepared, engine, selection, count, schedule)
    stimulus = sampled_stimulus(run, schedule)
    padded = -(-count // kernel.lanes) * kernel.lanes
    values = kernel.rows(padded, schedule.rows)
    counters = np.zeros((COUNTERS, padded))
    start = initial_vector(kernel.layout, run.state, run.memory)

    def group(first: int) -> None:
        cases = np.arange(first, first + kernel.lanes)
        vector = np.repeat(start[:, None], kernel.lanes, axis=1)
        columns = matrix[:, first : first + kernel.lanes]
        beyond = kernel.lanes - columns.shape[1]  # lanes that repeat the last case
        columns = np.concatenate((columns, np.repeat(columns[:, -1:], beyond, axis=1)), axis=1)
        rows = values[cases[0] : cases[-1] + 1]
        kernel.advance(schedule, columns, stimulus, vector, rows, schedule.frames)
        last = min(cases[-1], count - 1)
        require_finite(kernel.layout, vector, f"one of cases {first} to {last} diverged")
        counters[:, cases] = vector[kernel.layout.start["counters"] :]

    with thread_pool(threads or kernel.at_once) as pool:
        list(pool.map(group, range(0, padded, kernel.lanes)))
    return Ensemble(
        time=schedule.record_times,
        values=values[:count],
        names=tuple(signals),
        unsettled=counters[0, :count].astype(np.int64),
        repeated=counters[1, :count].astype(np.int64),
        engine=kernel.label,
    )


def _one_by_one(
    run: Run, variations: Variations, signals: tuple[str, ...], engine: str
) -> Ensemble:
    """Compute the cases one by one, for engines without lanes or without a compiler."""
    arrays = {name: np.atleast_1d(values) for name, values in variations.items()}
    count = next(iter(arrays.values())).size
    runs = [
        simulate(
            replace(run, par=run.par.replace({n: float(v[k]) for n, v in arrays.items()})),
            signals,
            engine,
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
