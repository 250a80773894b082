"""Many cases on a graphics processor, one thread per case: CUDA C, batches, and recorded rows."""

from __future__ import annotations

import copy
import math
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from bywire.core.errors import DeviceError
from bywire.core.interrupts import raise_if_stopped
from bywire.core.typing import Array
from bywire.simulation.c_runtime import ONE_LANE
from bywire.simulation.cuda_device import FLOAT, CudaDevice, Memory, find_device
from bywire.simulation.emit_single import Caller, emit_single
from bywire.simulation.native import Ends, Inputs, Request, plan_array
from bywire.simulation.program import Program
from bywire.simulation.schedule import Layout, Schedule
from bywire.simulation.stages import Stages, build_stages, layout_of, leaf_count

# --- Kernels of many cases
# The graphics processor computes cases in batches that fit into its memory, and each batch in time
# intervals. The host fetches the rows of each interval before the next interval starts. Intervals
# are short, so they do not block a display for long.
#
# Each number of a case is next to the same number of the next case. So threads that run together
# access adjacent memory. Rows have the layout of the caller's array. Each thread has its own
# branches and cuts, like a single run.

ENTRY = "bw_run_cases"
"""name of the kernel's function"""
THREADS = 64
"""threads per block; few, because each thread uses as many of the shared registers as possible"""

# After `stages.PLAN`: number of threads and of recorded cases, the first row of the stimulus in
# memory, the distances between the entries of two cases, rows and signals, the frames of the first
# and last rows, and for each number of a stimulus its place, and the distances between its values
# in two rows and in two cases.
_NUMBERS = 8
_BEGIN = """const int64_t cases = plan[8 + {tasks}], used = plan[9 + {tasks}];
  const int64_t ahead = plan[10 + {tasks}], by_case = plan[11 + {tasks}];
  const int64_t by_row = plan[12 + {tasks}], by_signal = plan[13 + {tasks}];
  const int64_t end0 = plan[14 + {tasks}], end1 = plan[15 + {tasks}];
  const int64_t *restrict us = plan + 16 + {tasks};
  const int64_t at = (int64_t)blockIdx.x * blockDim.x + threadIdx.x;
  if (at >= cases) return;
  state += at;
  rec += at * by_case;
  double p[{np} + 1];
  for (int k = 0; k < {np}; ++k) p[k] = par[k * cases + at];
  (void)chosen; (void)ends; (void)end0; (void)end1; (void)us; (void)used;"""

_THREADS = Caller(
    runtime=ONE_LANE,
    head=f"""KERNEL void __launch_bounds__({THREADS}) {ENTRY}(const double *restrict par, double h,
    const double *restrict u, double *restrict state, const int64_t *restrict plan,
    double *restrict rec, double *restrict ends)""",
    begin=_BEGIN,
    stimulus="u[us[3 * {k}] + at_row * us[3 * {k} + 1] + at * us[3 * {k} + 2]]",
    entry="state[{k} * cases]",
    row="const int64_t at_row = f / stim - ahead;\n    (void)at_row;",
    record="",
)
_RECORD = """if (at < used) {{{{
        double *row = rec + (f / every - row0) * by_row;
        for (int j = 0; j < {rows}; ++j) row[j * by_signal] = o[j];
        for (int j = {rows}; j < {{count}}; ++j) {{{{
          double *both = ends + 2 * ((j - {rows}) * used + at);
          if (f == end0) both[0] = o[j];
          if (f == end1) both[1] = o[j];
        }}}}
      }}}}"""


def emit_cuda(stages: Stages, ends: int = 0) -> str:
    """Return the CUDA C source of the kernel.

    It does not include the compiler's prologue, which is ``c_runtime.CUDA`` for NVRTC. ``ends``:
    number of outputs at the end of the list that the kernel records only in the first and last
    rows.
    """
    record = _RECORD.format(rows=len(stages.output) - ends)
    return emit_single(stages, replace(_THREADS, record=record))


# --- The kernel

MOST = 2**15
"""maximum number of cases in a batch: the number of threads that the largest processors can hold"""
_SUBSTEPS = 5000  # substeps per time interval
_SHARE = 0.5  # fraction of the free memory for a batch; thread stacks and other data need the rest


class CudaKernel:
    """Kernel for a batch of cases on a graphics processor.

    Parameters
    ----------
    device
        The graphics processor.
    stages
        Stages of the kernel for the requested signals.
    ends
        Number of signals at the end of the list that the kernel records only in the first and last
        rows.
    """

    at_once = 2
    """number of batches at a time: the host prepares or reads one while the device computes one"""
    shares_stimuli = True

    def __init__(self, device: CudaDevice, stages: Stages, ends: int = 0) -> None:
        self.layout: Layout = layout_of(stages)
        self.label = f"CUDA C, {device.label}"
        self.lanes = 1
        self._most = 2**62
        self._device, self._signals, self.ends = device, len(stages.output) - ends, ends
        self._inputs = leaf_count(stages, "p"), leaf_count(stages, "u")
        self._function = device.load(emit_cuda(stages, ends), ENTRY)

    def for_cases(self, count: int, schedule: Schedule) -> CudaKernel:
        """Return the kernel for batches that fit into memory, of about equal size.

        Raises
        ------
        DeviceError
            When a single case does not fit into memory.
        """
        free = self._device.free()
        room = int(_SHARE * free) - _plan_size(schedule, self._inputs[1])
        size, row = self._size(schedule), FLOAT * self._signals
        least = size + row * _most_rows(schedule)
        most = min(MOST, room // least)
        if most < 1:
            raise DeviceError(
                f"{self._device.label} has {free / 1e6:.3g} MB free. A case may use half of it, "
                f"but needs {least / 1e6:.3g} MB. Record fewer signals, or record them less often",
                name=self._device.label,
                value=f"{least / 1e6:.3g} MB",
                valid=f"{free / 1e6:.3g} MB free",
            )
        batches = -(-count // most)
        sized = copy.copy(self)
        sized.lanes = -(-count // batches)
        sized._most = (room // sized.lanes - size) // max(row, 1)
        return sized

    def rows(self, cases: int, rows: int) -> Array:
        """Return an array for recorded rows in the device's layout; see `CaseKernel`."""
        return self.array((rows, self._signals, cases)).transpose(2, 0, 1)

    def array(self, shape: tuple[int, ...]) -> Array:
        """Return an uninitialized array that the device fills fast; see `CaseKernel`."""
        return self._device.host_array(shape)

    def hold(self, shape: tuple[int, int, int]) -> HeldRows | None:
        """Return rows that stay on the device if they fit there together; see `CaseKernel`."""
        _, cases, rows = shape
        fits = cases == self.lanes and rows <= self._most
        return HeldRows(self._device, shape) if fits else None

    def advance(
        self,
        schedule: Schedule,
        parameters: Array,
        stimulus: Array | Inputs,
        vector: Array,
        rows: Array | Window,
        end: int,
        begin: int = 0,
        ends: Ends | None = None,
    ) -> None:
        """Run the frames from begin to end for one batch; see ``case_kernels.LaneKernel.advance``.

        ``stimulus``: rows for all cases, shape (rows, nu), or `Inputs`. ``rows``: an array, or a
        window of rows that stay on the device.

        Raises
        ------
        DeviceError
            When the device fails, or other programs have allocated its memory in the meantime.
        KeyboardInterrupt
            When the user interrupts the run, or stops it in a thread.
        """
        inputs = (
            stimulus
            if isinstance(stimulus, Inputs)
            else Inputs.of(lambda _: stimulus.T, 1, self.lanes)
        )
        frames = (-1, -1) if ends is None else ends.frames
        with self._device.working() as memory:
            state, par = memory.room(vector.nbytes), memory.room(parameters.nbytes)
            memory.put(state, vector)
            memory.put(par, parameters)
            given = _Given(memory, inputs, _stimulus_rows(schedule), self.array)
            plan = memory.room(_plan_size(schedule, self._inputs[1]))
            pieces = _pieces(schedule, begin, end)
            counts = [rows_between(schedule, *piece) for piece in pieces]
            recording: _Recording | _Staying
            if isinstance(rows, Window):
                recording, room = _Staying(rows), rows.place
            else:
                recording = _Recording(rows, counts, self._most)
                room = memory.room(recording.size)
            apart = np.empty(0) if ends is None else np.ascontiguousarray(ends.values)
            edges = memory.room(apart.nbytes)
            memory.put(edges, apart)
            for number, (first, last) in enumerate(pieces):
                raise_if_stopped()
                if not recording.fits(counts[number]):
                    recording.fetch(memory, room)
                if not recording.count:
                    recording.begin(counts[number:])
                ahead = first // schedule.stimulus_frames
                where = given.rows(ahead, last // schedule.stimulus_frames + 1)
                numbers = [*plan_array(schedule, first, last, self._signals)]
                numbers += [self.lanes, recording.cases, ahead, *recording.apart, *frames, *where]
                memory.put(plan, np.array(numbers, dtype=np.int64))
                place, step = int(room) + recording.offset, float(schedule.step)
                arguments = (par, step, given.place, state, plan, place, edges)
                memory.run(self._function, -(-self.lanes // THREADS), THREADS, arguments)
                recording.count += counts[number]
            recording.fetch(memory, room)
            memory.get(state, vector)
            if ends is not None:
                memory.get(edges, apart)
                ends.values[:] = apart

    def _size(self, schedule: Schedule) -> int:
        """Return the size in bytes of a case with its own stimulus, without recorded rows."""
        parameters, inputs = self._inputs
        stimulus = inputs * _stimulus_rows(schedule)
        return FLOAT * (parameters + self.layout.total + stimulus + 2 * self.ends)


def _plan_size(schedule: Schedule, inputs: int) -> int:
    """Return the size of a kernel's plan in bytes."""
    return FLOAT * (8 + len(schedule.task_frames) + _NUMBERS + 3 * inputs)


class _Given:
    """The stimulus of a batch on the device, a time interval at a time.

    Parameters
    ----------
    memory, inputs
        The device's memory, and the stimulus.
    most
        Maximum number of rows in an interval.
    array
        ``array(shape)`` allocates page-locked memory, from which copies are fast.
    """

    def __init__(
        self,
        memory: Memory,
        inputs: Inputs,
        most: int,
        array: Callable[[tuple[int, ...]], Array],
    ) -> None:
        self._memory, self._inputs = memory, inputs
        size = sum(len(each) * min(each.shape[1], most) for each in inputs.values)
        self.place = memory.room(FLOAT * size)
        self._buffer = array((size,))

    def rows(self, begin: int, end: int) -> list[int]:
        """Copy the rows from begin to end, and return the place and distances of each number."""
        parts = [each[:, begin:end] if each.shape[1] > 1 else each for each in self._inputs.values]
        if parts:
            filled = self._buffer[: sum(part.size for part in parts)]
            np.concatenate([part.ravel() for part in parts], out=filled)
            self._memory.put(self.place, filled)
        where, start = [], 0
        for part, each in zip(parts, self._inputs.values, strict=True):
            by_row = int(each.shape[1] > 1)
            where += [start, by_row, part.shape[1] if len(part) > 1 else 0]
            start += part.size
        return where


def _frames(schedule: Schedule) -> int:
    """Return the number of frames in a time interval."""
    return max(_SUBSTEPS // schedule.substeps, 1)


class _Recording:
    """Rows of several time intervals on the device, in the order of the caller's array.

    They are fetched directly into the caller's array, all at the end if they fit on the device.

    Parameters
    ----------
    rows
        The caller's array; see `CudaKernel.advance`.
    counts
        Number of rows of each interval.
    most
        Maximum number of rows on the device, at least those of one interval.
    """

    def __init__(self, rows: Array, counts: Sequence[int], most: int) -> None:
        self._rows, self._at, self.count, self.cases = rows, 0, 0, len(rows)
        self._order = sorted(range(3), key=lambda axis: -rows.strides[axis])
        self._most = max(min(most, sum(counts)), *counts)
        self.size = FLOAT * len(rows) * self._most * rows.shape[2]
        self.begin(counts)

    @property
    def offset(self) -> int:
        """Place of the next row on the device, from the first one [byte]."""
        return FLOAT * self.apart[1] * self.count

    def fits(self, count: int) -> bool:
        """Return whether there is room for so many more rows."""
        return self.count + count <= self._planned

    def begin(self, counts: Sequence[int]) -> None:
        """Plan to record the rows of the next intervals, as many as there is room for."""
        totals = np.cumsum(counts)
        self._planned = int(totals[totals <= self._most].max(initial=counts[0]))
        shape = len(self._rows), self._planned, self._rows.shape[2]
        inner = {
            axis: math.prod(shape[each] for each in self._order[place + 1 :])
            for place, axis in enumerate(self._order)
        }
        self.apart = [inner[axis] for axis in range(3)]

    def fetch(self, memory: Memory, room: Any) -> None:
        """Copy the rows into the caller's array."""
        if self.count:
            target = self._rows[:, self._at : self._at + self._planned]
            memory.get(room, target.transpose(self._order))
        self._at += self.count
        self.count = 0


class _Staying:
    """Rows of time intervals that stay where they are recorded; see `_Recording`."""

    def __init__(self, rows: Window) -> None:
        self.count, self.cases, self.apart = 0, rows.cases, rows.apart

    @property
    def offset(self) -> int:
        return FLOAT * self.count

    def fits(self, count: int) -> bool:
        return True

    def begin(self, counts: Sequence[int]) -> None:
        pass

    def fetch(self, memory: Memory, room: Any) -> None:
        pass


@dataclass(frozen=True)
class Window:
    """Part of `HeldRows` that a kernel fills.

    Parameters
    ----------
    place
        Address of its first row.
    cases
        Number of cases.
    apart
        Distances between cases, rows and signals, in numbers.
    """

    place: int
    cases: int
    apart: tuple[int, int, int]


EXTREMES_ENTRY = "bw_extremes"
EXTREMES = f"""
KERNEL void __launch_bounds__({THREADS}) {EXTREMES_ENTRY}(const int64_t *restrict sizes,
    const double *restrict rows, double *restrict extremes) {{
  const int64_t at = (int64_t)blockIdx.x * blockDim.x + threadIdx.x, n = sizes[1];
  if (at >= sizes[0]) return;
  const double *y = rows + at * n;
  double low = y[0], high = y[0];
  int is_finite = 1;
  for (int64_t k = 0; k < n; ++k) {{
    uint64_t bits;
    memcpy(&bits, y + k, sizeof(bits));
    is_finite &= (~bits & 0x7ff0000000000000u) != 0;
    low = y[k] < low ? y[k] : low;
    high = y[k] > high ? y[k] : high;
  }}
  const uint64_t bits = 0x7ff8000000000000u;
  if (!is_finite) memcpy(&low, &bits, sizeof(bits)), memcpy(&high, &bits, sizeof(bits));
  double *to = extremes + 4 * at;
  to[0] = y[0], to[1] = low, to[2] = high, to[3] = y[n - 1];
}}
"""
"""kernel for the extremes of rows, one thread for each signal of a case"""


class HeldRows:
    """Recorded rows that stay on the device, like an array of shape (signals, cases, rows).

    They are fetched on first use, signal by signal or all together, until they are closed.

    Parameters
    ----------
    device
        The graphics processor.
    shape
        Number of signals, cases and rows.
    """

    def __init__(self, device: CudaDevice, shape: tuple[int, int, int]) -> None:
        self.device, self.shape = device, shape
        self.place = device.keep(FLOAT * math.prod(shape))
        self.close = weakref.finalize(self, device.drop, self.place)
        self.close.atexit = False
        self._fetched: dict[int, Array] = {}

    def window(self, first: int) -> Window:
        """Return the part from a row on, for all signals and cases."""
        _, cases, rows = self.shape
        return Window(self.place + FLOAT * first, cases, (rows, 1, cases * rows))

    def signal(self, k: int) -> Array:
        """Return a signal, shape (cases, rows)."""
        if k not in self._fetched:
            self._fetched[k] = self._copied(self.address(k), self.shape[1:])
        return self._fetched[k]

    @cached_property
    def extremes(self) -> Array:
        """First, lowest, highest and last row of each signal, shape (signals, cases, 4).

        The lowest and the highest are NaN if a row is not finite.
        """
        signals, cases, rows = self.shape
        function = self.device.load(EXTREMES, EXTREMES_ENTRY)
        array = self.device.host_array((signals, cases, 4))
        with self.device.working() as memory:
            sizes, room = memory.room(2 * FLOAT), memory.room(array.nbytes)
            memory.put(sizes, np.array([signals * cases, rows]))
            arguments = sizes, self.place, room
            memory.run(function, -(-signals * cases // THREADS), THREADS, arguments)
            memory.get(room, array)
        return array

    def address(self, k: int) -> int:
        """Return the address of a signal, whose cases are contiguous, one after the other."""
        return self.place + FLOAT * k * self.shape[1] * self.shape[2]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self._copied(self.place, self.shape), dtype=dtype, copy=copy)

    def __getitem__(self, key: Any) -> Any:
        return np.asarray(self)[key]

    def _copied(self, place: int, shape: tuple[int, ...]) -> Array:
        if not self.close.alive:
            raise ValueError("these rows have been freed")
        array = self.device.host_array(shape)
        with self.device.working() as memory:
            memory.get(place, array)
        return array


def rows_between(schedule: Schedule, begin: int, end: int) -> int:
    """Return the number of recorded rows from frame begin up to end, exclusive unless the run ends.

    The kernel counts them in the same way, using its plan.
    """
    every = schedule.record_frames
    return -(-(end + int(end == schedule.frames)) // every) - -(-begin // every)


def _stimulus_rows(schedule: Schedule) -> int:
    """Return the maximum number of stimulus rows that a time interval reads."""
    return _frames(schedule) // schedule.stimulus_frames + 2


def _most_rows(schedule: Schedule) -> int:
    """Return the maximum number of rows that a time interval records, including the last row."""
    return _frames(schedule) // schedule.record_frames + 2


def _pieces(schedule: Schedule, begin: int, end: int) -> list[tuple[int, int]]:
    """Return first and end frame of each time interval; at a run's end, only its row remains."""
    edges = [*range(begin, end, _frames(schedule)), end]
    return list(pairwise(edges)) or [(begin, end)]


class CudaEngine:
    """Single runs on the graphics processor: slow, but bit-identical to those in a batch."""

    def __init__(self, program: Program) -> None:
        self._kernel = CudaKernel(find_device(), build_stages(program))
        self.layout, self.label = self._kernel.layout, self._kernel.label

    def advance(self, request: Request, state: Array, begin: int, end: int, rows: Array) -> None:
        """Run the frames from begin to end in place; see ``engine.Engine``."""
        schedule, vector = request.schedule, state[:, None].copy()
        count = rows_between(schedule, begin, end)
        recorded = self._kernel.rows(1, count)
        self._kernel.advance(
            schedule, request.parameters[:, None], request.stimulus, vector, recorded, end, begin
        )
        rows[:count] = recorded[0][:, request.selection]
        state[:] = vector[:, 0]
