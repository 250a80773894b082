"""Many cases on a graphics processor, a thread each, behind the face of a kernel in lanes.

Cases go to the processor in batches that its memory holds, and batches in pieces of time: what a
piece records is fetched before the next one, and no piece keeps a display waiting.

Every number of a case stands beside the same number of the next case, so that threads that run
together read and write neighbors; rows stand as who asks for them has them. A thread has branches
and cuts of its own, as a single run has.
"""

from __future__ import annotations

import copy
import math
from itertools import pairwise

import numpy as np

from bywire.core.errors import DeviceError
from bywire.core.typing import Array
from bywire.simulation.c_runtime import ONE_LANE
from bywire.simulation.cuda_device import CudaDevice, find_device
from bywire.simulation.emission import layout_of, leaf_count
from bywire.simulation.emit_single import Caller, emit_single
from bywire.simulation.layout import Layout
from bywire.simulation.native import Ends, Request, plan_array
from bywire.simulation.program import Program
from bywire.simulation.schedule import Schedule
from bywire.simulation.stages import Stages, build_stages

ENTRY = "bw_run_cases"
"""name of its function"""
THREADS = 64
"""threads of a block, which share a processor's registers, of which each takes as many as it may"""

# Behind `emission.PLAN`: how many cases, whether each has a stimulus of its own, which row of the
# stimulus is the first in memory, and the distances between the entries of two cases, rows and
# signals.
_BEGIN = """const int64_t cases = plan[8 + {tasks}], own = plan[9 + {tasks}];
  const int64_t ahead = plan[10 + {tasks}], by_case = plan[11 + {tasks}];
  const int64_t by_row = plan[12 + {tasks}], by_signal = plan[13 + {tasks}];
  const int64_t at = (int64_t)blockIdx.x * blockDim.x + threadIdx.x;
  if (at >= cases) return;
  const int64_t wide = own ? cases : 1;
  if (own) u += at;
  state += at;
  rec += at * by_case;
  double p[{np} + 1];
  for (int k = 0; k < {np}; ++k) p[k] = par[k * cases + at];
  (void)wide; (void)chosen;"""

_THREADS = Caller(
    runtime=ONE_LANE,
    head=f"""KERNEL void __launch_bounds__({THREADS}) {ENTRY}(const double *restrict par, double h,
    const double *restrict u, double *restrict state, const int64_t *restrict plan,
    double *restrict rec)""",
    begin=_BEGIN,
    stimulus="uk[{k} * wide]",
    entry="state[{k} * cases]",
    row="u + (f / stim - ahead) * {nu} * wide",
    record="""double *row = rec + (f / every - row0) * by_row;
      for (int j = 0; j < {count}; ++j) row[j * by_signal] = o[j];""",
)


def emit_cuda(stages: Stages) -> str:
    """Return the CUDA C of the kernel; before it stands what its compiler is to know first.

    That is ``c_runtime.CUDA`` for NVRTC.
    """
    return emit_single(stages, _THREADS)


# --- The kernel

MOST = 2**15
"""cases of a batch: as many threads as the largest processors hold at once"""
_SUBSTEPS = 5000  # of a piece of time
_SHARE = 0.5  # of the free memory that a batch may take; threads' stacks and others take some
_FLOAT = 8  # bytes


class CudaKernel:
    """Kernel for a batch of cases on a graphics processor.

    Parameters
    ----------
    device
        The graphics processor.
    stages
        What is computed, of the signals that are wanted.
    """

    at_once = 2
    """batches at a time: one is set up, or taken apart, while another is computed"""

    def __init__(self, device: CudaDevice, stages: Stages) -> None:
        self.layout: Layout = layout_of(stages)
        self.label = f"CUDA C, {device.label}"
        self.lanes = 1
        self._device, self._signals = device, len(stages.output)
        self._inputs = leaf_count(stages, "p"), leaf_count(stages, "u")
        self._function = device.load(emit_cuda(stages), ENTRY)

    def for_cases(self, count: int, schedule: Schedule) -> CudaKernel:
        """Return the kernel for batches of so many cases as memory holds, of about equal size.

        Raises
        ------
        DeviceError
            When it does not hold a single case.
        """
        free = self._device.free()
        size = self._size(schedule)
        most = min(MOST, int(_SHARE * free) // size)
        if most < 1:
            raise DeviceError(
                f"{self._device.label} has {free / 1e6:.3g} MB free, of which a case may take half "
                f"and takes {size / 1e6:.3g} MB: record fewer signals, or less often"
            )
        batches = -(-count // most)
        sized = copy.copy(self)
        sized.lanes = -(-count // batches)
        return sized

    def rows(self, cases: int, rows: int) -> Array:
        """Return room for what cases record, shape (cases, rows, signals), as the device has it."""
        return np.empty((rows, self._signals, cases)).transpose(2, 0, 1)

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
        """Run frames begin..end of one batch; see ``case_kernels.LaneKernel.advance``.

        ``ends`` are none: all outputs are recorded in all rows.

        Raises
        ------
        DeviceError
            When the device fails, or others have taken its memory meanwhile.
        """
        own = int(stimulus.ndim == 3)
        with self._device.working() as memory:
            state, par = memory.room(vector.nbytes), memory.room(parameters.nbytes)
            memory.put(state, vector)
            memory.put(par, parameters)
            given = memory.room(stimulus[: _stimulus_rows(schedule)].nbytes)
            plan = memory.room(_FLOAT * (len(schedule.task_frames) + 14))
            recording = _Recording(rows, self.lanes, _most_rows(schedule))
            room = memory.room(recording.size)
            for first, last in _pieces(schedule, begin, end):
                ahead = first // schedule.stimulus_frames
                memory.put(given, stimulus[ahead : last // schedule.stimulus_frames + 1])
                recording.begin(rows_between(schedule, first, last))
                said = [*plan_array(schedule, first, last, self._signals)]
                said += [self.lanes, own, ahead, *recording.apart]
                memory.put(plan, np.array(said, dtype=np.int64))
                memory.run(
                    self._function,
                    -(-self.lanes // THREADS),
                    THREADS,
                    (par, float(schedule.step), given, state, plan, room),
                )
                memory.get(room, recording.place)
                recording.end()
            memory.get(state, vector)

    def _size(self, schedule: Schedule) -> int:
        """Return the bytes of a case with a stimulus of its own."""
        parameters, inputs = self._inputs
        stimulus = inputs * _stimulus_rows(schedule)
        recorded = self._signals * _most_rows(schedule)
        return _FLOAT * (parameters + self.layout.total + stimulus + recorded)


def _frames(schedule: Schedule) -> int:
    """Return the frames of a piece of time."""
    return max(_SUBSTEPS // schedule.substeps, 1)


class _Recording:
    """Where the rows of a piece of time go: in the order of those who want them.

    Straight into their array where the piece has it to itself, else through room of its own.
    """

    def __init__(self, rows: Array, lanes: int, most: int) -> None:
        self._rows, self._lanes, self._at = rows, lanes, 0
        self._order = sorted(range(3), key=lambda axis: -rows.strides[axis])
        self._room = np.empty(lanes * most * rows.shape[2])
        self.size = self._room.nbytes
        self.begin(0)

    def begin(self, count: int) -> None:
        """Take so many rows more."""
        shape = self._lanes, count, self._rows.shape[2]
        self._target = self._rows[:, self._at : self._at + count]
        own = self._room[: math.prod(shape)].reshape([shape[axis] for axis in self._order])
        straight = self._target.transpose(self._order)
        is_whole = straight.shape == own.shape and straight.flags.c_contiguous
        self.place = straight if is_whole else own
        seen = self.place.transpose(np.argsort(self._order))
        self._seen = None if is_whole else seen
        self.apart = [stride // _FLOAT for stride in seen.strides]
        self._at += count

    def end(self) -> None:
        """Have the rows where they are wanted."""
        if self._seen is not None:
            self._target[:] = self._seen[: len(self._target)]


def rows_between(schedule: Schedule, begin: int, end: int) -> int:
    """Return how many rows are recorded from frame begin to before end; at the run's end its row.

    As the kernel counts them by its plan.
    """
    every = schedule.record_frames
    return -(-(end + int(end == schedule.frames)) // every) - -(-begin // every)


def _stimulus_rows(schedule: Schedule) -> int:
    """Return how many rows of a stimulus a piece of time reads at most."""
    return _frames(schedule) // schedule.stimulus_frames + 2


def _most_rows(schedule: Schedule) -> int:
    """Return how many rows a piece records at most, that of the end among them."""
    return _frames(schedule) // schedule.record_frames + 2


def _pieces(schedule: Schedule, begin: int, end: int) -> list[tuple[int, int]]:
    """Return the frames at which pieces begin and end; at the end of a run nothing but its row."""
    edges = [*range(begin, end, _frames(schedule)), end]
    return list(pairwise(edges)) or [(begin, end)]


class CudaEngine:
    """Single runs on the graphics processor: a batch of one, slow, with the digits of many."""

    def __init__(self, program: Program) -> None:
        self._kernel = CudaKernel(find_device(), build_stages(program))
        self.layout, self.label = self._kernel.layout, self._kernel.label

    def advance(self, request: Request, state: Array, begin: int, end: int, rows: Array) -> None:
        """Run frames begin..end in place; see ``engine.Engine``."""
        schedule, vector = request.schedule, state[:, None].copy()
        count = rows_between(schedule, begin, end)
        recorded = self._kernel.rows(1, count)
        self._kernel.advance(
            schedule, request.parameters[:, None], request.stimulus, vector, recorded, end, begin
        )
        rows[:count] = recorded[0][:, request.selection]
        state[:] = vector[:, 0]
