"""Ensembles: many cases of one model, in lanes on all cores, or on a graphics processor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError, unknown_name
from bywire.core.interrupts import thread_pool
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.simulation.advance import require_finite, require_unchanged
from bywire.simulation.case_kernels import case_kernel, is_side_by_side
from bywire.simulation.engine import prepare
from bywire.simulation.layout import COUNTERS
from bywire.simulation.run import Run, initial_vector, sampled_stimulus, selected, simulate

Variations = Mapping[str, Array | Sequence[float]]


def case_matrix(run: Run, variations: Variations) -> Array:
    """Return the parameter vectors of all cases, shape (parameters, cases).

    Ranges are checked for every value, rules within a group of parameters for every case, rules
    across groups at the extremes of each parameter.

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
        raise ParameterError(f"variations must have one length >= 1 each, got {lengths}")
    count = next(iter(lengths.values()))
    matrix = np.repeat(np.array(list(run.par.leaves().values()))[:, None], count, axis=1)
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
            raise ParameterError(f"{name} is a sample time and cannot vary within an ensemble")


def _check_group(par: ParameterSet, group: str, arrays: Mapping[str, Array], count: int) -> None:
    """Check the rules between the parameters of a group for every case, where it has rules."""
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
            raise ParameterError(f"case {k}: {error}") from None


def _has_rules(cls: type[ParameterSet]) -> bool:
    inner = (info.annotation for info in cls.model_fields.values())
    return bool(cls.__pydantic_decorators__.model_validators) or any(
        isinstance(kind, type) and issubclass(kind, ParameterSet) and _has_rules(kind)
        for kind in inner
    )


# --- The ensemble


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
        Dotted name of a parameter -> its value in each case, shape (cases,). What is not named
        keeps its value. Sample times cannot vary. All cases start from the state and memory of
        ``run``: where a varied parameter moves the equilibrium, let the run settle first.
    signals
        Outputs to record.
    threads
        Threads to use, >= 1; all cores by default.
    engine
        ``auto`` and ``compiled``: in lanes, ``cuda``: on a graphics processor, a thread for each
        case, both side by side; others, and ``auto`` without a compiler, one after the other.

    Returns
    -------
    Ensemble
        Times [s], shape (samples,), and each signal in its SI unit, shape (cases, samples).

    Raises
    ------
    UnknownNameError
        When a parameter, a signal or an engine is unknown.
    SolverError
        When a trajectory leaves the numbers.
    ParameterError
        When a value is out of range, lengths differ, or a sample time varies.
    CompilerError
        For ``compiled`` without a compiler.
    DeviceError
        For ``cuda`` where there is no graphics processor, or no room on it.
    """
    prepared = prepare(run.model, run.par)
    if threads is not None and threads < 1:
        raise ParameterError(f"threads = {threads} is not valid: it must be >= 1")
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
        # Lanes beyond the last case repeat it.
        columns = np.ascontiguousarray(matrix[:, np.minimum(cases, count - 1)])
        rows = values[cases[0] : cases[-1] + 1]
        kernel.advance(schedule, columns, stimulus, vector, rows, schedule.frames)
        last = min(cases[-1], count - 1)
        require_finite(kernel.layout, vector, f"one of cases {first} to {last} left the numbers")
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
    """Serve engines without lanes, and without a compiler: the cases one after the other."""
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
