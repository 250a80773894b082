"""Compile, load and call the hand-written C of a brake."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.hand_source import Subject
from bywire.core.errors import CompilerError
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.simulation.compiler import SINGLE, find_compiler, load_library
from bywire.simulation.native import pointer
from bywire.simulation.run import Run

WITHOUT_SUMS = ("-DWITHOUT_SUMS",)
"""omits the energies, whose outputs are then meaningless, for runs that do not record energies"""
_COUNTERS = 2  # the first counter: substeps that did not settle


@dataclass(frozen=True)
class Call:
    """A prepared call that repeats the same computation from the start each time.

    Parameters
    ----------
    names, values
        Outputs, with values of shape (cases, rows, signals). Each call fills them.
    state
        Initial State and Memory, then counters, shape (cases, length). Each call fills them.
    substeps
        Total number of substeps of all cases.
    """

    names: tuple[str, ...]
    values: Array
    state: Array
    substeps: int
    _inputs: tuple[NDArray[Any], ...]  # must stay alive, because the arguments are bare addresses
    _call: Callable[[], None]

    def __call__(self) -> float:
        """Compute once and return the processor time [s]."""
        begin = time.process_time()
        self._call()
        return time.process_time() - begin

    def __getitem__(self, name: str) -> Array:
        """Return one output, shape (cases, rows)."""
        return np.asarray(self.values[:, :, self.names.index(name)])

    @property
    def unsettled(self) -> int:
        """Substeps whose contacts did not settle."""
        return int(self.state[:, -2].sum())

    @property
    def extra(self) -> int:
        """The second counter, whose meaning depends on the C code."""
        return int(self.state[:, -1].sum())


class HandCode:
    """The compiled library, for one run or for an ensemble of scalar runs one by one.

    Parameters
    ----------
    subject
        The brake.
    par
        Any parameter set with the structure that the C covers.
    flags
        ``SINGLE``, the flags of bywire's single runs, and optionally ``WITHOUT_SUMS``. They are in
        addition to the flags of all kernels, so the benchmark compares code and not settings.

    Raises
    ------
    CompilerError
        If there is no C compiler.
    """

    def __init__(
        self, subject: Subject, par: ParameterSet, flags: tuple[str, ...] = SINGLE
    ) -> None:
        self._subject = subject
        self.label, library = load(subject.text(par), flags, "hand_run")
        self._run, self._ensemble = library.hand_run, library.hand_ensemble
        self._run.restype = self._ensemble.restype = None

    def single(self, run: Run) -> Call:
        """Prepare one run that records all outputs."""
        outputs = self._subject.outputs
        shared, state, values = arrays(run, [run.par], outputs)
        arguments = (*plan_arguments(run, shared), pointer(state), pointer(values))
        return Call(outputs, values, state, _substeps(run), shared, lambda: self._run(*arguments))

    def ensemble(self, run: Run, cases: Sequence[ParameterSet], signals: Sequence[str]) -> Call:
        """Prepare one run per parameter set, with initial values and stimulus from ``run``.

        ``run``: a run whose parameters determine only the structure; ``cases``: parameter sets;
        ``signals``: outputs to record.
        """
        shared, state, values = arrays(run, cases, signals)
        selected = np.array([self._subject.outputs.index(s) for s in signals], dtype=np.int32)
        arguments = (
            ctypes.c_int64(len(cases)),
            *plan_arguments(run, shared),
            pointer(state),
            ctypes.c_int64(selected.size),
            pointer(selected),
            pointer(values),
        )
        kept = (*shared, selected)
        count = len(cases) * _substeps(run)
        return Call(tuple(signals), values, state, count, kept, lambda: self._ensemble(*arguments))


def load(text: str, flags: tuple[str, ...], entry: str) -> tuple[str, ctypes.CDLL]:
    """Compile C with a function, and return its label in tables and the library.

    Raises
    ------
    CompilerError
        If there is no C compiler, or if the compilation fails.
    """
    compiler = find_compiler()
    if compiler is None:
        raise CompilerError("the hand-written C needs a C compiler. Install one")
    library, _ = load_library(text, flags, compiler, entry)
    return f"hand-written C, {compiler.label}, {' '.join(flags)}", library


def arrays(
    run: Run, cases: Sequence[ParameterSet], signals: Sequence[str]
) -> tuple[tuple[Array, Array], Array, Array]:
    """Return parameters and stimulus, initial states, and arrays for the outputs.

    Raises
    ------
    ValueError
        If the recording rate differs from the rate of the slowest controller.
    """
    schedule = run.schedule()
    if schedule.record_frames != max(schedule.task_frames) or min(schedule.task_frames) != 1:
        raise ValueError(
            "the hand-written C records once per tick of the slowest controller. Set record to "
            "the sample time of this controller"
        )
    parameters = np.array([list(par.leaves().values()) for par in cases], dtype=np.float64)
    stimulus = np.ascontiguousarray(run.stimulus(schedule.stimulus_times), dtype=np.float64)
    state = np.tile([*run.state, *run.memory, *[0.0] * _COUNTERS], (len(cases), 1))
    values = np.empty((len(cases), schedule.rows, len(signals)))
    return (parameters, stimulus), state, values


def plan_arguments(run: Run, shared: tuple[Array, Array]) -> tuple[Any, ...]:
    """Return the arguments of a C function for parameters, steps and stimulus."""
    parameters, stimulus = shared
    schedule = run.schedule()
    return (
        pointer(parameters),
        ctypes.c_double(schedule.step),
        ctypes.c_int64(schedule.frames),
        ctypes.c_int64(schedule.substeps),
        pointer(stimulus),
    )


def _substeps(run: Run) -> int:
    schedule = run.schedule()
    return schedule.frames * schedule.substeps
