"""Compiled kernels and CasADi functions, called with raw pointers and buffers."""

from __future__ import annotations

import ctypes
import hashlib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.interrupts import raise_if_stopped
from bywire.core.typing import Array
from bywire.simulation.compiler import SINGLE, Compiler, load, load_library
from bywire.simulation.schedule import Layout, Schedule

if TYPE_CHECKING:
    from bywire.simulation.program import Program

CHUNK = 50_000
"""substeps per call of a kernel; a call takes tens of milliseconds"""

_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.S)


@dataclass(frozen=True)
class Request:
    """Inputs of a kernel, as contiguous arrays.

    Parameters
    ----------
    parameters
        Shape (np,).
    stimulus
        Shape (stimulus rows, nu).
    selection
        Indices of the outputs to record, int32.
    """

    schedule: Schedule
    parameters: Array
    stimulus: Array
    selection: NDArray[np.int32]


@dataclass(frozen=True)
class Ends:
    """Destination of the signals that are recorded only in the first and last rows.

    Parameters
    ----------
    values
        Shape (signals, cases, 2), contiguous for each signal.
    frames
        Frames of the first and the last row.
    """

    values: Array
    frames: tuple[int, int]


@dataclass(frozen=True)
class Inputs:
    """Stimulus of several cases, without repetitions.

    Parameters
    ----------
    values
        Values of each number of a stimulus row, shape (cases, rows). The first dimension is 1 if
        all cases have equal values, and the second one is 1 if the values do not change.
    """

    values: tuple[Array, ...]

    @classmethod
    def of(cls, rows_of: Callable[[int], Array], cases: int, lanes: int) -> Inputs:
        """Return the stimulus of some cases; idle lanes repeat the last case.

        ``rows_of(case)``: its stimulus, shape (nu, rows), computed again for each call.
        """
        first = rows_of(0)
        bits = first.view(np.int64)
        is_shared, is_constant = np.ones((2, len(first)), dtype=bool)
        starts = np.empty((len(first), lanes))
        own, apart = np.arange(0), np.empty((0, lanes, first.shape[1]))
        for case in range(cases):
            each = rows_of(case) if case else first
            own_bits = each.view(np.int64)  # also tell the two zeros apart
            is_shared &= (own_bits == bits).all(axis=1)
            is_constant &= (own_bits == own_bits[:, :1]).all(axis=1)
            starts[:, case] = each[:, 0]
            if case == 1:  # usually, these are the numbers that differ in all cases
                own = np.flatnonzero(~is_shared & ~is_constant)
                apart = np.empty((len(own), lanes, first.shape[1]))
                apart[:, 0] = first[own]
            apart[:, case] = each[own]
        starts[:, cases:] = starts[:, cases - 1 : cases]
        apart[:, cases:] = apart[:, cases - 1 : cases]
        every = np.flatnonzero(~is_shared & ~is_constant)
        if len(every) > len(own):
            own, apart = every, np.empty((len(every), lanes, first.shape[1]))
            for lane in range(lanes):
                apart[:, lane] = rows_of(min(lane, cases - 1))[own]
        values = [
            first[k : k + 1] if is_shared[k] else starts[k][:, None] for k in range(len(first))
        ]
        for k, rows in zip(own.tolist(), apart, strict=True):
            values[k] = rows
        return cls(tuple(values))

    def with_noise(self, noise: Mapping[int, Array]) -> Inputs:
        """Return these inputs with other numbers by column, shape (cases, rows) each."""
        return Inputs(tuple(noise.get(k, values) for k, values in enumerate(self.values)))


def plan_array(schedule: Schedule, begin: int, end: int, selected: int) -> NDArray[np.int64]:
    """Return the kernel's plan for the frames from begin to end, with the row at the run's end."""
    return np.array(
        [
            begin,
            end,
            int(end == schedule.frames),
            schedule.substeps,
            schedule.stimulus_frames,
            schedule.record_frames,
            -(-begin // schedule.record_frames),
            selected,
            *schedule.task_frames,
        ],
        dtype=np.int64,
    )


def run_in_calls(
    schedule: Schedule,
    begin: int,
    end: int,
    call: Callable[[int, int, int], int],
    most: int = CHUNK,
) -> None:
    """Run the frames from begin to end in several calls, with a check for interrupts in between.

    Parameters
    ----------
    call
        ``call(first, last, row)`` runs frames, writes rows starting at ``row``, and returns the
        frame that it reached, which may be before ``last``.
    most
        Maximum number of substeps per call. A longer frame is a single call.

    Raises
    ------
    KeyboardInterrupt
        When the user interrupts the run, or stops it in a thread.
    """
    every, size = schedule.record_frames, max(most // schedule.substeps, 1)
    at = begin
    while True:
        raise_if_stopped()
        at = call(at, min(at + size, end), -(-at // every) - -(-begin // every))
        if at >= end:
            return


def pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    """Return the address of a C-contiguous array."""
    if not array.flags.c_contiguous:
        raise ValueError("kernels accept only C-contiguous arrays")
    return ctypes.c_void_p(array.ctypes.data)


def rows_pointer(rows: NDArray[Any]) -> Callable[[int], ctypes.c_void_p]:
    """Return a function of a row's number that returns the row's address."""
    first, size = pointer(rows).value or 0, rows.strides[0]
    return lambda row: ctypes.c_void_p(first + row * size)


def text_digest(text: str) -> str:
    """Return the digest of a kernel's C code without comments."""
    return hashlib.sha256(_COMMENT.sub("", text).encode()).hexdigest()


class SingleKernel:
    """Compiled kernel for one run."""

    ENTRY = "bw_run"
    """name of the kernel's function in the library"""

    def __init__(self, layout: Layout, library: Path, compiler: Compiler, digest: str = "") -> None:
        self.layout, self.library, self.compiler = layout, library, compiler
        self.digest = digest
        self.label = f"compiled C, {compiler.label}"
        self._run = load(library, self.ENTRY)[self.ENTRY]
        self._run.restype = ctypes.c_int64

    @classmethod
    def of(cls, program: Program, compiler: Compiler) -> SingleKernel:
        """Emit the kernel of a program, and compile it unless it is in the cache."""
        from bywire.simulation.emit_single import emit_single
        from bywire.simulation.stages import build_stages, layout_of

        stages = build_stages(program)
        text = emit_single(stages)
        _, library = load_library(text, SINGLE, compiler, cls.ENTRY)
        return cls(layout_of(stages), library, compiler, text_digest(text))

    def advance(self, request: Request, state: Array, begin: int, end: int, rows: Array) -> None:
        """Run the frames from begin to end; update ``state`` and fill ``rows`` in place.

        Parameters
        ----------
        state
            State vector, see ``layout.Layout``.
        rows
            Shape (recorded rows of these frames, selected outputs).
        """
        step = ctypes.c_double(request.schedule.step)
        inputs = (pointer(request.parameters), step, pointer(request.stimulus), pointer(state))
        selection, row_at = pointer(request.selection), rows_pointer(rows)

        def call(first: int, last: int, row: int) -> int:
            plan = plan_array(request.schedule, first, last, request.selection.size)
            return int(self._run(*inputs, pointer(plan), selection, row_at(row)))

        run_in_calls(request.schedule, begin, end, call)


# --- CasADi functions


class BufferedCall:
    """Function for many calls by one caller at a time.

    Parameters
    ----------
    function
        CasADi function with dense arguments and results.
    """

    def __init__(self, function: Any) -> None:
        self._buffer, self._trigger = function.buffer()
        self._inputs = [np.zeros(function.nnz_in(k)) for k in range(function.n_in())]
        self._outputs = [np.zeros(function.nnz_out(k)) for k in range(function.n_out())]
        for k, array in enumerate(self._inputs):
            self._buffer.set_arg(k, memoryview(array.data))
        for k, array in enumerate(self._outputs):
            self._buffer.set_res(k, memoryview(array.data))

    def __call__(self, *arguments: Array) -> list[Array]:
        """Return the results, column by column. The next call overwrites them."""
        for own, given in zip(self._inputs, arguments, strict=True):
            own[:] = given
        self._trigger()
        return self._outputs
